// Bars over time, a row for each feature: seen, and rejected in its lower part.

function Timeline(part) {
  const row = 18, width = pictureWidth(), left = Math.min(130, 0.36 * width), right = 18, foot = 40;
  const height = part.rows.length * row + foot, bottom = height - foot;
  const axis = axisOf(part.begin, part.end > part.begin ? part.end : part.begin + 1, left, width - right, false);
  const now = draw("line", { class: "now", y1: 0, y2: bottom, visibility: "hidden" });
  const bars = part.rows.flatMap((label, k) => [
    draw("text", { x: left - 8, y: k * row + 13, "text-anchor": "end", text: shortened(label, Math.floor((left - 8) / LETTER)) },
      draw("title", { text: label })),
    ...runs(part.seen[k]).map((run) => bar("seen", run, k * row + 3, row - 6)),
    ...runs(part.rejected[k] || "").map((run) => bar("rejected", run, k * row + row - 7, 5)),
  ]);

  function bar(kind, run, y, thick) {
    const step = (width - left - right) / run.bins;
    const opacity = kind === "seen" ? 0.15 + (0.75 * run.digit) / 9 : 0.25 + (0.75 * run.digit) / 9;
    const x = (left + run.from * step).toFixed(1), long = Math.max(run.count * step, 1.2).toFixed(1);
    return draw("rect", { class: kind, x, width: long, y, height: thick, "fill-opacity": opacity.toFixed(2) });
  }

  function runs(digits) {
    const found = [];
    for (let k = 0; k < digits.length; k += 1) {
      const digit = Number(digits[k]), last = found[found.length - 1];
      if (last && last.digit === digit && last.from + last.count === k) last.count += 1;
      else if (digit) found.push({ digit, from: k, count: 1, bins: digits.length });
    }
    return found;
  }

  const ticks = ticksBelow(axis, 9, width).flatMap(({ x, middle, text }) => [
    draw("line", { class: "grid", x1: x, x2: x, y1: 0, y2: bottom }),
    draw("text", { x: middle, y: bottom + 17, "text-anchor": "middle", text }),
  ]);
  const share = (digits) => Math.round((100 * [...digits].reduce((sum, digit) => sum + Number(digit) / 9, 0)) / Math.max(digits.length, 1));
  const spokenRows = part.rows.slice(0, 40).map((label, k) => `${label} ${share(part.seen[k])} %`);
  const spoken = `${part.title}: share of the time that each feature is seen: ${spokenRows.join(", ")}`;
  const picture = draw("svg", { viewBox: `0 0 ${width} ${height}`, role: "img", "aria-label": spoken },
    ...ticks, ...bars, now, draw("text", { x: (left + width - right) / 2, y: height - 6, "text-anchor": "middle", text: "time in s" }));
  picture.addEventListener("click", (event) => {
    const box = picture.getBoundingClientRect(), pixel = ((event.clientX - box.left) / box.width) * width;
    if (pixel >= left) clock.set(Math.min(Math.max(axis.value(pixel), part.begin), part.end));
  });
  clock.follow((time) => {
    now.setAttribute("visibility", time >= part.begin && time <= part.end ? "visible" : "hidden");
    for (const end of ["x1", "x2"]) now.setAttribute(end, axis.at(time));
  });
  return [picture];
}
