// The page: title, verdict, contents, and each part drawn by its kind.

const KINDS = {
  scene: Scene, chart: Chart, timeline: Timeline, sheet: Sheet, facts: Facts, words: Words, tabs: Tabs,
};

function Sheet(part) {
  const side = (index) => (index < part.left ? "left" : null);
  const head = el("thead", {}, el("tr", {}, ...part.headings.map((text, k) => el("th", { scope: "col", class: side(k), text }))));
  const rows = part.rows.map((row) => el("tr", {}, ...row.map((text, k) => el("td", { class: side(k), text }))));
  const table = el("table", { "aria-label": part.title }, head, el("tbody", {}, ...rows));
  const box = el("div", { class: part.rows.length > 16 ? "scroll tall" : "scroll" }, table);
  const hint = el("p", { class: "about hint", text: "wider than the screen: scroll sideways for more columns →", hidden: true });
  new ResizeObserver(() => {
    const hides = box.scrollWidth > box.clientWidth || box.scrollHeight > box.clientHeight; // then keys can scroll it
    for (const [name, value] of Object.entries({ tabindex: "0", role: "group", "aria-label": part.title })) {
      if (hides) box.setAttribute(name, value); else box.removeAttribute(name);
    }
    hint.hidden = box.scrollWidth <= box.clientWidth;
  }).observe(box);
  return [hint, box];
}

function Facts(part) {
  return [el("dl", {}, ...part.items.flatMap(([name, value]) => [el("dt", { text: name }), el("dd", { text: value })]))];
}

function Words(part) {
  const code = part.code.length ? [el("pre", {}, el("code", { text: part.code.join("\n") }))] : [];
  return [el("ul", { class: "words" }, ...part.lines.map((text) => el("li", { text }))), ...code];
}

const unfolding = []; // what draws the tabs that are not yet drawn: paper has them all
window.addEventListener("beforeprint", () => { for (const unfold of unfolding) unfold(); });

function Tabs(part, level) {
  const panels = part.choices.map(([name]) => el("div", { role: "tabpanel", id: newId("panel"), "aria-label": name, hidden: true }));
  const tabs = part.choices.map(([text], k) => el("button", {
    type: "button", role: "tab", id: newId("tab"), "aria-controls": panels[k].id, text, onclick: () => pick(k),
    onkeydown: (event) => {
      const step = { ArrowLeft: -1, ArrowRight: 1 }[event.key];
      if (step) { pick((k + step + tabs.length) % tabs.length); tabs[(k + step + tabs.length) % tabs.length].focus(); }
    },
  }));
  function fill(index) {
    const [name, parts] = part.choices[index];
    if (panels[index].childNodes.length) return;
    panels[index].append(el("p", { class: "only-paper", text: `${part.title}: ${name}` }), ...parts.map((inner) => section(inner, Math.min(level + 1, 6))));
  }
  function pick(index) {
    panels.forEach((panel, k) => { panel.hidden = k !== index; });
    tabs.forEach((tab, k) => { tab.setAttribute("aria-selected", String(k === index)); tab.setAttribute("tabindex", k === index ? "0" : "-1"); });
    fill(index);
  }
  unfolding.push(() => part.choices.forEach((_, k) => fill(k)));
  pick(part.first);
  return [el("div", { role: "tablist", "aria-label": part.title }, ...tabs), ...panels];
}

function section(part, level) {
  const long = part.kind === "tabs" || (part.rows && part.rows.length > 25);
  const node = el("section", { class: long ? "part long" : "part", id: newId(part.kind), "aria-label": part.title });
  node.append(...head(part, level), ...KINDS[part.kind](part, level));
  return node;
}

const anyScene = (parts) => parts.some((part) => part.kind === "scene" || (part.choices || []).some(([, inner]) => anyScene(inner)));

const report = JSON.parse(document.getElementById("data").textContent);
const sections = report.parts.map((part) => section(part, 2));
const verdicts = { good: "Good", warn: "With limits", bad: "Do not trust" };
const links = report.parts.map((part, k) => el("li", {}, el("a", { href: `#${sections[k].id}`, text: part.title })));
const contents = el("nav", { "aria-label": "Contents" }, el("ul", {}, ...links));
const verdict = report.verdict
  ? [el("div", { class: `verdict ${report.verdict[0]}`, role: "note" }, el("b", { text: `${verdicts[report.verdict[0]]}. ` }), report.verdict[1])]
  : [];
const frame = anyScene(report.parts) ? "Frame C: origin at the chaser, axes that do not turn. " : "";
const foot = `Made by baryscope ${report.version}. ${frame}All in this file; nothing is loaded from elsewhere.`;
document.getElementById("page").append(
  ...top(report.title, report.subtitle, "Skip to the report"),
  ...verdict,
  ...report.notes.map((text) => el("p", { text })),
  contents,
  el("main", { id: "main" }, ...sections),
  el("footer", {}, el("p", { class: "soft", text: foot })),
);
document.documentElement.dataset.ready = "true";
window.dispatchEvent(new Event("theme"));
