// Charts of curves, bands and points: legend, choice of a feature, zoom, and a reading under pointer or arrow keys.

const Chart = (part) => chartOf(part).nodes;

// The nodes of a chart, and what draws it anew after its series have changed.
function chartOf(part) {
  const size = { width: pictureWidth(), height: 0, left: 66, right: 18, top: 12, bottom: 44 };
  const state = { shown: part.series.map((one) => one.shown), zoom: null, only: -1, pointer: null };
  const reading = el("output", { class: "reading", "aria-live": "polite" });
  const picture = draw("svg", { role: "img", tabindex: "0" });
  const axes = {}, now = draw("line", { class: "now", visibility: "hidden" }), pointer = draw("line", { class: "pointer", visibility: "hidden" });
  const reset = el("button", { type: "button", text: "whole range", hidden: true, class: "only-screen", onclick: () => { state.zoom = null; render(); } });

  function render() {
    const whole = extent(part.series.flatMap((one) => limits(one.x)), part.log_x);
    if (whole[0] === whole[1]) whole[1] += 1;
    if (part.log_x) { const aside = (whole[1] / whole[0]) ** 0.03; whole[0] /= aside; whole[1] *= aside; } // steps at the ends are seen
    picture.setAttribute("aria-label", spoken(part));
    reset.hidden = !state.zoom;
    size.top = 12 + LINE * part.marks.length; // the words of marks stand above the frame, those of levels beside it
    size.height = 318 + size.top;
    if (part.levels.length) size.right = 12 + Math.max(...part.levels.map(([, text]) => text.length)) * LETTER;
    picture.setAttribute("viewBox", `0 0 ${size.width} ${size.height}`);
    const [from, to] = state.zoom || whole;
    axes.y = axisOf(...heights(from, to), size.height - size.bottom, size.top, part.log);
    const ticks = axes.y.ticks(6);
    size.left = 30 + Math.max(5, ...ticks.map(({ text }) => text.length)) * LETTER;
    axes.x = axisOf(from, to, size.left, size.width - size.right, part.log_x);
    const frame = { x: size.left, y: size.top, width: size.width - size.left - size.right, height: size.height - size.top - size.bottom };
    const within = (box, ...nodes) => {
      const clip = newId("clip");
      return [draw("clipPath", { id: clip }, draw("rect", box)), draw("g", { "clip-path": `url(#${clip})` }, ...nodes)];
    };
    const curves = part.series.map(curve), pointed = (node, index) => ["points", "cross"].includes(part.series[index].style);
    picture.replaceChildren(
      ...grid(ticks),
      ...within(frame, ...shades(), ...levels()), ...marks(),
      ...within(frame, ...part.series.map(band), ...curves.filter((node, index) => !pointed(node, index))),
      ...within({ ...frame, x: frame.x - 4, width: frame.width + 8 }, ...curves.filter(pointed)), // those of the first and last frame are whole
      ...within(frame, now, pointer), draw("rect", { class: "axis", ...frame }), ...names(), ...words(),
    );
    for (const line of [now, pointer]) { line.setAttribute("y1", size.top); line.setAttribute("y2", size.height - size.bottom); }
    moveNow(clock.time);
  }

  function heights(from, to) {
    const values = [];
    part.series.forEach((one, index) => {
      if (!state.shown[index]) return;
      for (let k = 0; k < one.x.length; k += 1) {
        if (one.x[k] < from || one.x[k] > to || one.y[k] === null || !chosen(one, k)) continue;
        values.push(one.y[k]);
        if (one.high) values.push(one.high[k]);
        if (one.low && !part.log) values.push(one.low[k]);
      }
    });
    if (part.levels.length && values.length) values.push(...part.levels.map((one) => one[0]));
    let [low, high] = extent(values, part.log);
    if (part.log) {
      low = Math.max(low, high * 1e-8);
      const room = part.levels.length ? Math.max(1.25, (high / low) ** 0.1) : 1.25; // for the words of the levels
      return low * 1.5 > high ? [low / 3, high * 3] : [low / room, high * room];
    }
    const margin = 0.06 * (high - low) || Math.abs(high) * 0.1 || 1;
    return [low - margin, high + margin];
  }

  const chosen = (one, k) => state.only < 0 || !one.of || one.of[k] === state.only;
  const yAt = (value) => (part.log ? axes.y.at(Math.max(value, axes.y.low * 1e-3)) : axes.y.at(value));

  function curve(one, index) {
    if (!state.shown[index]) return "";
    let path = "", pen = false;
    for (let k = 0; k < one.x.length; k += 1) {
      if (one.y[k] === null || !chosen(one, k)) { pen = false; continue; }
      const x = axes.x.at(one.x[k]).toFixed(1), y = yAt(one.y[k]).toFixed(1);
      if (one.style === "points") path += `M${x} ${y}h0`;
      else if (one.style === "cross") path += `M${x} ${y}m-3-3l6 6m0-6l-6 6`;
      else if (pen) path += `L${x} ${y}`;
      else path += k + 1 === one.x.length || one.y[k + 1] === null ? `M${x - 1.5} ${y}h3` : `M${x} ${y}`;
      pen = true;
    }
    return draw("path", { class: `curve ${one.style}`, style: key(one.colour), d: path });
  }

  function band(one, index) {
    if (!state.shown[index] || !one.low) return "";
    let path = "", run = [];
    const close = () => {
      if (run.length > 1) {
        const there = run.map((k) => `${axes.x.at(one.x[k]).toFixed(1)} ${yAt(one.high[k]).toFixed(1)}`);
        const back = run.map((k) => `${axes.x.at(one.x[k]).toFixed(1)} ${yAt(one.low[k]).toFixed(1)}`).reverse();
        path += `M${there.concat(back).join("L")}Z`;
      }
      run = [];
    };
    for (let k = 0; k < one.x.length; k += 1) {
      if (one.low[k] === null || one.high[k] === null) close();
      else run.push(k);
    }
    close();
    return draw("path", { class: "band", style: key(one.colour), d: path });
  }

  const shades = () => part.shades.map(([begin, end]) => draw("rect", {
    class: "shade", x: axes.x.at(begin), width: Math.max(0, axes.x.at(end) - axes.x.at(begin)), y: size.top, height: size.height - size.top - size.bottom,
  }));
  const levels = () => part.levels.map(([value]) =>
    draw("line", { class: "level", x1: size.left, x2: size.width - size.right, y1: yAt(value), y2: yAt(value) }));
  // Those that are within the range, each with the row of its words: above the frame, where its line goes.
  const marked = () => part.marks
    .map(([value, text], k) => ({ x: axes.x.at(value), text, foot: 12 + LINE * k, value }))
    .filter(({ value }) => value >= axes.x.low && value <= axes.x.high);
  const marks = () => marked().map(({ x, foot }) => draw("line", { class: "mark", x1: x, x2: x, y1: foot - 9, y2: size.height - size.bottom }));
  // From a level to the foot of its words: above it, but below the lowest, and where the next one leaves them no room.
  function besideLevel(value) {
    const others = part.levels.map((one) => one[0]).filter((other) => other !== value);
    const next = Math.min(...others.filter((other) => other > value));
    const below = others.every((other) => other > value) || yAt(value) - yAt(next) < LINE;
    return others.length && below ? 14 : -6;
  }
  // Of levels and marks: outside of the frame, so that they hide no curve.
  const names = () => [
    ...part.levels.map(([value, text]) => draw("text", { x: size.width - size.right + 6, y: yAt(value) + besideLevel(value), text })),
    ...marked().map(({ x, text, foot }) => {
      const before = x + 5 + text.length * LETTER > size.width;
      return draw("text", { x: before ? x - 5 : x + 5, y: foot, "text-anchor": before ? "end" : "start", text });
    }),
  ];

  function grid(ticks) {
    const vertical = ticksBelow(axes.x, 9, size.width).flatMap(({ x, middle, text }) => [
      draw("line", { class: "grid", x1: x, x2: x, y1: size.top, y2: size.height - size.bottom }),
      draw("text", { x: middle, y: size.height - size.bottom + 17, "text-anchor": "middle", text }),
    ]);
    const horizontal = ticks.flatMap(({ value, text }) => [
      draw("line", { class: "grid", x1: size.left, x2: size.width - size.right, y1: axes.y.at(value), y2: axes.y.at(value) }),
      draw("text", { x: size.left - 7, y: axes.y.at(value) + 4, "text-anchor": "end", text }),
    ]);
    return [...vertical, ...horizontal];
  }

  const words = () => [
    draw("text", { x: (size.left + size.width - size.right) / 2, y: size.height - 8, "text-anchor": "middle", text: part.x_label }),
    draw("text", { transform: `translate(14 ${(size.top + size.height - size.bottom) / 2}) rotate(-90)`, "text-anchor": "middle", text: part.y_label }),
  ];

  function place(line, x) {
    const inside = x !== null && x >= axes.x.low && x <= axes.x.high;
    line.setAttribute("visibility", inside ? "visible" : "hidden");
    if (inside) for (const end of ["x1", "x2"]) line.setAttribute(end, axes.x.at(x));
  }
  const moveNow = (time) => place(now, part.timed ? time : null);

  function read(x, y) {
    state.pointer = x;
    place(pointer, x);
    if (x === null) { reading.textContent = ""; return; }
    const found = [];
    part.series.forEach((one, index) => {
      if (!state.shown[index] || !one.x.length) return;
      if (one.of) found.push(...readPoint(one, x, y));
      else {
        const k = nearest(one.x, x);
        const between = one.low && one.low[k] !== null ? ` (${shown(one.low[k])} to ${shown(one.high[k])})` : "";
        found.push(`${one.label.split(":")[0]} ${shown(one.y[k])}${between}`);
      }
    });
    reading.textContent = `${part.timed ? `t = ${timeText(x)} s` : shown(x)}: ${found.join("; ")}`;
  }

  function readPoint(one, x, y) {
    let best = null, least = y === null ? 1e9 : 400;
    const at = axes.x.at(x);
    for (let k = 0; k < one.x.length; k += 1) {
      if (!chosen(one, k)) continue;
      const dx = axes.x.at(one.x[k]) - at, dy = y === null ? 0 : yAt(one.y[k]) - y;
      if (dx * dx + dy * dy < least) { least = dx * dx + dy * dy; best = k; }
    }
    if (best === null) return [];
    return [`${part.filter[one.of[best]] ?? `feature ${one.of[best] + 1}`} ${shown(one.y[best])} (${labelled(one)})`];
  }

  function position(event) {
    const box = picture.getBoundingClientRect();
    return [((event.clientX - box.left) / box.width) * size.width, ((event.clientY - box.top) / box.height) * size.height];
  }
  const clamped = (pixel) => axes.x.value(Math.min(Math.max(pixel, size.left), size.width - size.right));

  let start = null, zooming = null;
  picture.addEventListener("pointerdown", (event) => { if (event.button === 0) [start] = position(event); });
  picture.addEventListener("pointermove", (event) => {
    const [x, y] = position(event);
    read(clamped(x), y);
    if (start === null) return;
    if (!zooming && Math.abs(x - start) > 8) {
      zooming = draw("rect", { class: "zooming", y: size.top, height: size.height - size.top - size.bottom });
      picture.append(zooming);
      picture.setPointerCapture(event.pointerId);
    }
    if (zooming) { zooming.setAttribute("x", Math.min(x, start)); zooming.setAttribute("width", Math.abs(x - start)); }
  });
  picture.addEventListener("pointerup", (event) => {
    const [x] = position(event);
    if (zooming && start !== null) { state.zoom = [clamped(Math.min(x, start)), clamped(Math.max(x, start))]; render(); }
    else if (start !== null && part.timed) clock.set(clamped(x));
    start = null; zooming = null;
  });
  picture.addEventListener("pointerleave", () => { if (!zooming) { start = null; read(null, null); } });
  picture.addEventListener("dblclick", () => { state.zoom = null; render(); });
  picture.addEventListener("keydown", (event) => {
    const step = { ArrowLeft: -1, ArrowRight: 1 }[event.key];
    if (event.key === "Escape") { state.zoom = null; render(); }
    if (!step) return;
    event.preventDefault();
    const from = state.pointer ?? clock.time ?? axes.x.low;
    const x = clamped(axes.x.at(from) + step * (event.shiftKey ? 80 : 10));
    read(x, null);
    if (part.timed) clock.set(x);
  });

  const legend = part.series.map((one, index) => el("button", {
    type: "button", class: `key ${one.style}`, style: key(one.colour), text: labelled(one), "aria-pressed": String(state.shown[index]),
    onclick: (event) => {
      state.shown[index] = !state.shown[index];
      event.currentTarget.setAttribute("aria-pressed", String(state.shown[index]));
      render();
    },
  }));
  const controls = el("div", { class: "controls", role: "group", "aria-label": `Curves of ${part.title}` }, ...legend);
  const [earliest, latest] = extent(part.series.flatMap((one) => limits(one.x)), false);
  const shaded = part.shade && part.shades.some(([begin, end]) => end > earliest && begin < latest);
  if (shaded) controls.append(el("span", { class: "soft", text: `shaded: ${part.shade}` }));
  if (part.filter.length > 1) controls.append(choice("feature", ["all", ...part.filter], (index) => { state.only = index - 1; render(); }));
  controls.append(reset);
  render();
  if (part.timed) clock.follow(moveNow);
  return { nodes: [controls, picture, reading], update: render };
}

const labelled = ({ label, total, x }) => (total > x.length ? `${label}, ${x.length} of ${total} drawn` : label);

function choice(name, options, pick, first = 0) {
  const list = el("select", { onchange: (event) => pick(event.currentTarget.selectedIndex) }, ...options.map((text) => el("option", { text })));
  list.selectedIndex = first;
  return el("label", { class: "only-screen" }, name, list);
}

function limits(values) {
  let low = Infinity, high = -Infinity;
  for (const value of values) if (value !== null) { low = Math.min(low, value); high = Math.max(high, value); }
  return low <= high ? [low, high] : [];
}

function extent(values, log) {
  const [low, high] = limits(log ? values.filter((value) => value > 0) : values);
  return low === undefined ? [log ? 0.1 : 0, 1] : [low, high];
}

function spoken(part) {
  const curves = part.series.map((one) => {
    const [low, high] = limits(one.y);
    return `${labelled(one)}${low === undefined ? "" : `, from ${shown(low)} to ${shown(high)}`}`;
  });
  return `${part.title}: ${part.y_label} over ${part.x_label}. ${curves.join("; ")}. Arrow keys read values.`;
}
