// The scene: an orthographic picture on a canvas, centred on the centre of mass, that is turned, enlarged and played.

const VIEWS = ["target", "chaser and target", "errors and ellipsoids"];

function Scene(part) {
  const count = part.time.length, features = part.labels.length;
  const triple = (flat, k) => [flat[3 * k], flat[3 * k + 1], flat[3 * k + 2]];
  const known = (v) => v[0] !== null && v[0] !== undefined;
  const state = { k: 0, azimuth: -0.9, elevation: 0.45, zoom: 1, view: 0, axes: 0, playing: null, shape: true, names: false, trail: true, ghosts: [] };
  const frames = [["inertial axes", () => IDENTITY]];
  if (part.orbit) frames.push(["LVLH axes", (k) => transposed(matrix(part.orbit, k))]);
  if (part.attitude) frames.push(["body axes", (k) => transposed(lastKnown(part.attitude, k))]);
  if (part.orbit) state.axes = 1;

  const canvas = el("canvas", { role: "img", tabindex: "0", "aria-label": "The scene in three dimensions. Drag or arrow keys turn it, plus and minus enlarge it, space plays." });
  const reading = el("output", { class: "reading scene-reading", "aria-live": "off" });
  const slider = el("input", { type: "range", min: 0, max: count - 1, step: 1, value: 0, "aria-label": "Time", oninput: () => { stop(); show(Number(slider.value), true); } });
  const play = el("button", { type: "button", class: "play", text: "▶ play", "aria-pressed": "false", onclick: toggle });
  const length_of_play = [15, 60, 180];
  let seconds = 60;

  function matrix(flat, k) {
    return fromQuaternion(flat[4 * k], flat[4 * k + 1], flat[4 * k + 2], flat[4 * k + 3]);
  }

  function lastKnown(flat, k) {
    for (let j = k; j >= 0; j -= 1) if (flat[4 * j] !== null) return matrix(flat, j);
    for (let j = k; j < count; j += 1) if (flat[4 * j] !== null) return matrix(flat, j);
    return IDENTITY;
  }

  const feature = (k, j) => triple(part.features, k * features + j);
  const covariance = (ghost, k) => (ghost.covariance ? ghost.covariance.slice(6 * k, 6 * k + 6) : null);
  const sizes = { target: reachOf(), range: rangeOf() };

  function reachOf() {
    let most = 0;
    const step = Math.max(1, Math.floor(count / 50));
    for (let k = 0; k < count; k += step) for (let j = 0; j < features; j += 1) if (known(feature(k, j))) most = Math.max(most, norm(feature(k, j)));
    return most || 1;
  }

  function rangeOf() {
    let most = 0;
    for (let k = 0; k < count; k += 1) most = Math.max(most, norm(triple(part.path, k)));
    return most || 1;
  }

  // How far an estimate is off, or claims to be, in the middle of its times: those that are much worse than the best
  // are hidden at first.
  function typical(ghost) {
    const sizes = [];
    for (let k = 0; k < count; k += Math.max(1, Math.floor(count / 50))) {
      const v = triple(ghost.offset, k), C = covariance(ghost, k);
      if (known(v)) sizes.push(Math.max(norm(v), C && C[0] !== null ? Math.sqrt(C[0] + C[3] + C[5]) : 0));
    }
    return sizes.sort((one, other) => one - other)[sizes.length >> 1] ?? Infinity;
  }
  const typicals = part.ghosts.map(typical), best = Math.min(...typicals);
  state.ghosts = typicals.map((size) => size <= 8 * best || size === best);

  function errorSize() {
    let most = 0;
    part.ghosts.forEach((ghost, index) => {
      if (!state.ghosts[index]) return;
      const v = triple(ghost.offset, state.k), C = covariance(ghost, state.k);
      if (known(v)) most = Math.max(most, norm(v));
      if (C && C[0] !== null) most = Math.max(most, 3 * Math.sqrt(C[0] + C[3] + C[5]));
    });
    return most || sizes.target;
  }

  const radius = () => [1.04 * sizes.target, 1.08 * Math.max(sizes.range, sizes.target), 1.3 * errorSize()][state.view] / state.zoom;

  function colours() {
    const style = getComputedStyle(document.documentElement), found = {};
    for (const name of ["ink", "soft", "line", "face", "accent", "paper", "c0", "c1", "c2", "c3", "c4", "c5", "c6", "c7"]) found[name] = style.getPropertyValue(`--${name}`).trim();
    return found;
  }

  function render() {
    const ratio = window.devicePixelRatio || 1, width = canvas.clientWidth, height = canvas.clientHeight;
    if (!width || !height) return;
    if (canvas.width !== Math.round(width * ratio)) canvas.width = Math.round(width * ratio);
    if (canvas.height !== Math.round(height * ratio)) canvas.height = Math.round(height * ratio);
    const pen = canvas.getContext("2d"), colour = colours(), k = state.k;
    pen.setTransform(ratio, 0, 0, ratio, 0, 0);
    pen.clearRect(0, 0, width, height);
    const scale = Math.min(width, height) / 2 / radius();
    const eye = looking(state.azimuth, state.elevation), axes = frames[state.axes][1](k), V = product(eye, axes);
    const seen = (v, by = V) => { const p = turn(by, v); return [width / 2 + scale * p[0], height / 2 - scale * p[1], p[2]]; };
    const view = { pen, colour, scale, V, eye, seen, k, width, height };
    if (state.trail) trails(view);
    sight(view);
    if (state.shape && state.view !== 2) shape(view);
    points(view);
    if (part.orbit) orbitAxes(view);
    part.ghosts.forEach((ghost, index) => { if (state.ghosts[index]) ghostly(view, ghost); });
    centre(view);
    ruler(view);
  }

  function line(view, from, to, colour, width = 1.2, dashes = []) {
    const { pen } = view;
    pen.beginPath(); pen.setLineDash(dashes); pen.moveTo(from[0], from[1]); pen.lineTo(to[0], to[1]);
    pen.strokeStyle = colour; pen.lineWidth = width; pen.stroke(); pen.setLineDash([]);
  }

  function word(view, text, x, y, colour) {
    view.pen.font = "12px system-ui, sans-serif";
    view.pen.fillStyle = colour;
    view.pen.fillText(text, x, y);
  }

  // Where the chaser has been, and where the estimates have been, as seen from the centre of mass in the chosen axes.
  function trails(view) {
    const { pen, colour, seen, eye } = view, step = Math.max(1, Math.floor(count / 700));
    const trail = (where, paint) => {
      pen.beginPath();
      let down = false;
      for (let j = 0; j < count; j += step) {
        const v = where(j);
        if (!known(v)) { down = false; continue; }
        const p = seen(v, product(eye, frames[state.axes][1](j)));
        if (down) pen.lineTo(p[0], p[1]); else pen.moveTo(p[0], p[1]);
        down = true;
      }
      pen.strokeStyle = paint; pen.lineWidth = 1; pen.globalAlpha = 0.45; pen.stroke(); pen.globalAlpha = 1;
    };
    if (state.view === 1) trail((j) => triple(part.path, j).map((one) => -one), colour.soft);
    if (state.view === 2) part.ghosts.forEach((ghost, index) => { if (state.ghosts[index]) trail((j) => triple(ghost.offset, j), colour[`c${ghost.colour % 8}`]); });
  }

  function sight(view) {
    const { colour, seen, k } = view, chaser = triple(part.path, k).map((one) => -one);
    const to = seen(chaser), from = seen([0, 0, 0]);
    line(view, from, to, colour.accent, 1.3, [6, 4]);
    if (to[0] > 0 && to[0] < view.width && to[1] > 0 && to[1] < view.height) {
      view.pen.fillStyle = colour.accent;
      view.pen.fillRect(to[0] - 5, to[1] - 5, 10, 10);
      word(view, "chaser", to[0] + 9, to[1] + 4, colour.accent);
      return;
    }
    const length2 = Math.hypot(to[0] - from[0], to[1] - from[1]);
    if (length2 > 40) word(view, "to the chaser", from[0] + (to[0] - from[0]) * 130 / length2 + 6, from[1] + (to[1] - from[1]) * 130 / length2, colour.accent);
  }

  function shape(view) {
    const { pen, colour, V, seen, k } = view, faces = [];
    for (let f = 0; f < part.faces.length; f += 3) {
      const corners = [0, 1, 2].map((i) => feature(k, part.faces[f + i]));
      if (!corners.every(known)) continue;
      const normal = cross(minus(corners[1], corners[0]), minus(corners[2], corners[0])), size = norm(normal) || 1;
      const facing = Math.abs(turn(V, normal)[2]) / size;
      const drawn = corners.map((corner) => seen(corner));
      faces.push({ drawn, depth: drawn[0][2] + drawn[1][2] + drawn[2][2], facing });
    }
    faces.sort((one, other) => one.depth - other.depth);
    for (const { drawn, facing } of faces) {
      pen.beginPath();
      drawn.forEach((p, i) => (i ? pen.lineTo(p[0], p[1]) : pen.moveTo(p[0], p[1])));
      pen.closePath();
      pen.globalAlpha = 0.16 + 0.3 * facing; pen.fillStyle = colour.face; pen.fill();
      pen.globalAlpha = 0.5; pen.strokeStyle = colour.soft; pen.lineWidth = 0.8; pen.stroke();
      pen.globalAlpha = 1;
    }
  }

  function points(view) {
    const { pen, colour, seen, k } = view;
    for (let j = 0; j < features; j += 1) {
      const v = feature(k, j), what = part.state[k][j];
      if (!known(v)) continue;
      const [x, y] = seen(v);
      pen.beginPath(); pen.arc(x, y, 4, 0, 7);
      pen.fillStyle = what === "2" ? colour.c3 : what === "1" ? colour.ink : colour.paper;
      pen.strokeStyle = what === "2" ? colour.c3 : what === "1" ? colour.ink : colour.soft;
      pen.lineWidth = 1.2; pen.fill(); pen.stroke();
      if (state.names) word(view, part.labels[j], x + 7, y - 5, colour.soft);
    }
  }

  function orbitAxes(view) {
    const R = matrix(part.orbit, view.k), size = (state.view === 0 ? 0.75 : 0.3) * radius();
    ["radial", "along-track", "cross-track"].forEach((name, column) => {
      const end = view.seen([R[column] * size, R[3 + column] * size, R[6 + column] * size]);
      line(view, view.seen([0, 0, 0]), end, view.colour.c2, 1.4);
      word(view, name, end[0] + 4, end[1] - 4, view.colour.c2);
    });
  }

  function ghostly(view, ghost) {
    const { pen, colour, seen, scale, V, k } = view, v = triple(ghost.offset, k), C = covariance(ghost, k), paint = colour[`c${ghost.colour % 8}`];
    if (!known(v)) return;
    const [x, y] = seen(v);
    if (C && C[0] !== null) {
      const { long, short, angle } = outline(turnedCovariance(V, C));
      pen.beginPath(); pen.ellipse(x, y, Math.max(3 * long * scale, 0.5), Math.max(3 * short * scale, 0.5), -angle, 0, 2 * Math.PI);
      pen.globalAlpha = 0.16; pen.fillStyle = paint; pen.fill(); pen.globalAlpha = 1;
      pen.strokeStyle = paint; pen.lineWidth = 1.4; pen.stroke();
    }
    pen.beginPath(); pen.arc(x, y, 3.5, 0, 7); pen.fillStyle = paint; pen.fill();
    if (state.view === 2) word(view, ghost.label, x + 9, y + 4 + 14 * part.ghosts.indexOf(ghost), paint);
  }

  function centre(view) {
    const { pen, colour, seen } = view, [x, y] = seen([0, 0, 0]);
    pen.strokeStyle = colour.ink; pen.lineWidth = 1.6;
    pen.beginPath(); pen.moveTo(x - 8, y); pen.lineTo(x + 8, y); pen.moveTo(x, y - 8); pen.lineTo(x, y + 8); pen.stroke();
  }

  function ruler(view) {
    const wide = view.width / 5 / view.scale, power = 10 ** Math.floor(Math.log10(wide));
    const size = [5, 2, 1].map((one) => one * power).find((one) => one <= wide), y = view.height - 16;
    line(view, [14, y], [14 + size * view.scale, y], view.colour.ink, 2);
    word(view, length(size), 14, y - 6, view.colour.ink);
  }

  function show(k, tell = false) {
    state.k = k;
    slider.value = k;
    const seconds_text = `${moment(part.time[k])} s`;
    slider.setAttribute("aria-valuetext", seconds_text);
    const digits = part.state[k], seen = [...digits].filter((one) => one !== "0").length, rejected = [...digits].filter((one) => one === "2").length;
    const words = [`t = ${seconds_text}`, `range ${length(norm(triple(part.path, k)))}`, `${seen} of ${features} features seen${rejected ? `, ${rejected} rejected` : ""}`];
    part.ghosts.forEach((ghost, index) => {
      const v = triple(ghost.offset, k), C = covariance(ghost, k);
      if (!state.ghosts[index] || !known(v)) return;
      const claim = C && C[0] !== null ? `±${length(Math.sqrt(C[0] + C[3] + C[5]))}` : "";
      const off = norm(v) ? `off by ${length(norm(v))}` : "";
      if (claim || off) words.push(`${ghost.label} ${[off, claim].filter(Boolean).join(", ")}`);
    });
    reading.textContent = words.join(" · ");
    render();
    if (tell) clock.set(part.time[k]);
  }

  function toggle() { if (state.playing === null) start(); else stop(); }

  function start() {
    let last = performance.now(), at = state.k >= count - 1 ? 0 : state.k;
    play.textContent = "⏸ pause"; play.setAttribute("aria-pressed", "true");
    const begin = part.time[0], whole = part.time[count - 1] - begin;
    let time = part.time[at];
    const tick = (stamp) => {
      time += ((stamp - last) / 1e3) * (whole / seconds);
      last = stamp;
      at = Math.min(nearest(part.time, Math.min(time, begin + whole)), count - 1);
      if (at !== state.k) show(at, true);
      if (time >= begin + whole) stop(); else state.playing = requestAnimationFrame(tick);
    };
    state.playing = requestAnimationFrame(tick);
  }

  function stop() {
    if (state.playing !== null) cancelAnimationFrame(state.playing);
    state.playing = null;
    play.textContent = "▶ play"; play.setAttribute("aria-pressed", "false");
  }

  function rotate(right, up) {
    state.azimuth -= right;
    state.elevation = Math.min(Math.max(state.elevation + up, -Math.PI / 2), Math.PI / 2);
    render();
  }
  function enlarge(factor) { state.zoom = Math.min(Math.max(state.zoom * factor, 1e-3), 1e6); render(); }

  let grip = null;
  canvas.addEventListener("pointerdown", (event) => { grip = [event.clientX, event.clientY]; canvas.setPointerCapture(event.pointerId); });
  canvas.addEventListener("pointermove", (event) => {
    if (!grip) return;
    rotate((event.clientX - grip[0]) / 150, (event.clientY - grip[1]) / 150);
    grip = [event.clientX, event.clientY];
  });
  for (const name of ["pointerup", "pointercancel"]) canvas.addEventListener(name, () => { grip = null; });
  canvas.addEventListener("wheel", (event) => { if (document.activeElement !== canvas && !event.ctrlKey) return; event.preventDefault(); enlarge(1.0015 ** -event.deltaY); }, { passive: false });
  canvas.addEventListener("keydown", (event) => {
    const turns = { ArrowLeft: [-0.1, 0], ArrowRight: [0.1, 0], ArrowUp: [0, 0.1], ArrowDown: [0, -0.1] }[event.key];
    if (turns) rotate(...turns);
    else if (event.key === "+" || event.key === "=") enlarge(1.25);
    else if (event.key === "-") enlarge(0.8);
    else if (event.key === " ") toggle();
    else return;
    event.preventDefault();
  });

  const tick = (text, name) => el("label", {}, el("input", { type: "checkbox", checked: state[name], onchange: (event) => { state[name] = event.currentTarget.checked; render(); } }), text);
  const legend = part.ghosts.map((ghost, index) => el("button", {
    type: "button", class: "key points", style: key(ghost.colour), text: ghost.label, "aria-pressed": String(state.ghosts[index]),
    onclick: (event) => { state.ghosts[index] = !state.ghosts[index]; event.currentTarget.setAttribute("aria-pressed", String(state.ghosts[index])); show(state.k); },
  }));
  const views = choice("look at", VIEWS, (index) => { state.view = index; state.zoom = 1; show(state.k); });
  const axes = choice("in", frames.map(([name]) => name), (index) => { state.axes = index; render(); }, state.axes);
  const pace = choice("all in", length_of_play.map((one) => `${one} s`), (index) => { seconds = length_of_play[index]; }, 1);
  const bigger = [["+", "enlarge", 1.25], ["−", "make smaller", 0.8]].map(([text, name, factor]) => el("button", { type: "button", text, "aria-label": name, class: "only-screen", onclick: () => enlarge(factor) }));
  const meaning = `The cross is the ${part.path_label}; ellipsoids are 3σ; filled features are seen, hollow ones are not, red ones are rejected.`
    + (part.every > 1.01 ? ` One of ${Math.round(part.every * 10) / 10} frames is shown.` : "");

  new ResizeObserver(render).observe(canvas);
  for (const name of ["theme", "beforeprint", "afterprint"]) window.addEventListener(name, render);
  clock.follow((time) => { const k = nearest(part.time, time); if (k !== state.k && state.playing === null) show(k); });
  show(0);
  return [
    el("p", { class: "about", text: meaning }),
    el("div", { class: "controls", role: "group", "aria-label": "View" }, views, axes, ...bigger, tick("shape", "shape"), tick("names", "names"), tick("trails", "trail")),
    el("div", { class: "controls", role: "group", "aria-label": "Estimates" }, ...legend),
    canvas,
    el("div", { class: "controls", role: "group", "aria-label": "Time" }, play, slider, pace),
    reading,
  ];
}
