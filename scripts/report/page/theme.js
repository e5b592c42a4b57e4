// Light and dark: as the system has it until the reader says another; light on paper.

function theme(name) {
  document.documentElement.dataset.theme = name;
  window.dispatchEvent(new Event("theme"));
}

const dark = window.matchMedia("(prefers-color-scheme: dark)");
document.documentElement.dataset.theme = dark.matches ? "dark" : "light";
dark.addEventListener("change", () => theme(dark.matches ? "dark" : "light"));
let beforePrint = null;
window.addEventListener("beforeprint", () => { beforePrint = document.documentElement.dataset.theme; theme("light"); });
window.addEventListener("afterprint", () => { if (beforePrint) theme(beforePrint); });

// The title of a page, the button for light and dark, and a sentence; skip: what the link for keyboards leads over to #main.
function top(title, subtitle, skip) {
  const other = () => theme(document.documentElement.dataset.theme === "dark" ? "light" : "dark");
  return [
    el("a", { class: "skip", href: "#main", text: skip }),
    el("header", { class: "top" },
      el("h1", { text: title }),
      el("button", { type: "button", class: "theme", text: "light / dark", onclick: other }),
      el("p", { class: "soft", text: subtitle })),
  ];
}
