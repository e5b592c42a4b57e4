// The stage: an orthographic picture of moments on a canvas, centred on the centre of mass, that is turned and enlarged.

const VIEWS = ["target", "chaser and target", "errors and ellipsoids"];
const AXES = { "inertial axes": () => IDENTITY, "LVLH axes": (moment) => away(moment.orbit), "body axes": (moment) => away(moment.attitude) };
const PAINTS = ["ink", "soft", "line", "face", "accent", "paper", "panel", "c0", "c1", "c2", "c3", "c4", "c5", "c6", "c7"];

const NAME = 40; // letters

const away = (quaternion) => (known(quaternion) ? transposed(fromQuaternion(...quaternion)) : IDENTITY);

// what: { labels, faces, of the features; ghosts: [{ label, colour, shown }]; axes: names in AXES, and which is first;
// reach: of the features from the centre, m; farthest: () → the longest path, m; past: { count: () → …, at: (j) → a moment
// without features }, for trails; toggle: what the space bar does; changed: told when an estimate is shown or hidden }.
// Stages of the same `what` turn together. view: at first, of VIEWS.
function Stage(what, view = 0) {
  what.camera ??= { azimuth: -0.9, elevation: 0.45, axes: what.first, shape: true, names: false, trail: true };
  what.pictures ??= [];
  what.pictures.push(render);
  const state = { zoom: 1, view }, { camera } = what, spoken = view ? `${VIEWS[view]} in three dimensions` : "The scene in three dimensions";
  const canvas = el("canvas", { role: "img", tabindex: "0", "aria-label": `${spoken}. Drag or arrow keys turn it, plus and minus enlarge it, space plays.` });
  let now = null, colour = null;

  const redraw = () => { for (const picture of what.pictures) picture(); };

  function errorSize() {
    let most = 0;
    now.ghosts.forEach(({ offset, covariance }, index) => {
      if (!what.ghosts[index].shown) return;
      if (known(offset)) most = Math.max(most, norm(offset));
      if (known(covariance)) most = Math.max(most, 3 * deviation(covariance));
    });
    return most || what.reach;
  }

  const radius = () => [() => 1.04 * what.reach, () => 1.08 * Math.max(what.farthest(), what.reach), () => 1.3 * errorSize()][state.view]() / state.zoom;
  const inAxes = (moment) => AXES[what.axes[camera.axes]](moment);
  const paintOf = (index) => colour[`c${what.ghosts[index].colour % 8}`];

  function colours() {
    const style = getComputedStyle(document.documentElement);
    return Object.fromEntries(PAINTS.map((name) => [name, style.getPropertyValue(`--${name}`).trim()]));
  }

  function render() {
    const ratio = window.devicePixelRatio || 1, width = canvas.clientWidth, height = canvas.clientHeight;
    if (!now || !width || !height) return;
    if (canvas.width !== Math.round(width * ratio)) canvas.width = Math.round(width * ratio);
    if (canvas.height !== Math.round(height * ratio)) canvas.height = Math.round(height * ratio);
    const pen = canvas.getContext("2d");
    colour = colour || colours();
    pen.setTransform(ratio, 0, 0, ratio, 0, 0);
    pen.clearRect(0, 0, width, height);
    const scale = Math.min(width, height) / 2 / radius();
    const eye = looking(camera.azimuth, camera.elevation), V = product(eye, inAxes(now));
    const seen = (v, by = V) => { const p = turn(by, v); return [width / 2 + scale * p[0], height / 2 - scale * p[1], p[2]]; };
    const view = { pen, scale, V, eye, seen, width, height, words: [], marks: [] };
    if (camera.trail && state.view !== 0) trails(view);
    sight(view);
    if (camera.shape && state.view !== 2) shape(view);
    points(view);
    if (known(now.orbit)) orbitAxes(view);
    now.ghosts.forEach((ghost, index) => { if (what.ghosts[index].shown) ghostly(view, ghost, index); });
    centre(view);
    ruler(view);
    if (camera.names) names(view);
    words(view);
  }

  function line(view, from, to, paint, width = 1.2, dashes = []) {
    const { pen } = view;
    pen.beginPath(); pen.setLineDash(dashes); pen.moveTo(from[0], from[1]); pen.lineTo(to[0], to[1]);
    pen.strokeStyle = paint; pen.lineWidth = width; pen.stroke(); pen.setLineDash([]);
  }

  // Those that are told first have the better places.
  function words({ pen, width, height, words: told, marks }) {
    const lettering = Lettering(pen, width, height);
    for (const mark of marks) lettering.keepOff(...mark);
    for (const { text, at, paint, gap, places } of told) lettering.put(text, at[0], at[1], paint, colour.panel, gap, places);
  }

  // Where the chaser has been, and where the estimates have been, as seen from the centre of mass in the chosen axes.
  function trails(view) {
    const { pen, seen, eye } = view, from = state.view === 2 ? what.past.recent() : 0, count = what.past.count(), turned = [];
    for (let j = from; j < count; j += Math.max(1, Math.floor((count - from) / 700))) {
      const moment = what.past.at(j);
      turned.push([moment, product(eye, inAxes(moment))]);
    }
    const trail = (where, paint) => {
      pen.beginPath();
      let down = false;
      for (const [moment, by] of turned) {
        const v = where(moment);
        if (!known(v)) { down = false; continue; }
        const p = seen(v, by);
        if (down) pen.lineTo(p[0], p[1]); else pen.moveTo(p[0], p[1]);
        down = true;
      }
      pen.strokeStyle = paint; pen.lineWidth = 1; pen.globalAlpha = 0.45; pen.stroke(); pen.globalAlpha = 1;
    };
    if (state.view === 1) trail((moment) => moment.path.map((one) => -one), colour.soft);
    else what.ghosts.forEach((ghost, index) => { if (ghost.shown) trail((moment) => moment.ghosts[index].offset, paintOf(index)); });
  }

  function sight(view) {
    const { seen } = view, chaser = now.path.map((one) => -one);
    const to = seen(chaser), from = seen([0, 0, 0]);
    line(view, from, to, colour.accent, 1.3, [6, 4]);
    if (to[0] > 0 && to[0] < view.width && to[1] > 0 && to[1] < view.height) {
      view.pen.fillStyle = colour.accent;
      view.pen.fillRect(to[0] - 5, to[1] - 5, 10, 10);
      view.marks.push([...to.slice(0, 2), 5]);
      view.words.push({ text: "chaser", at: to, paint: colour.accent, gap: 9 });
      return;
    }
    const length2 = Math.hypot(to[0] - from[0], to[1] - from[1]);
    const at = [0, 1].map((i) => from[i] + (to[i] - from[i]) * 130 / length2);
    if (length2 > 40) view.words.push({ text: "to the chaser", at, paint: colour.accent, gap: 6 });
  }

  function shape(view) {
    const { pen, V, seen } = view, faces = [];
    for (let f = 0; f < what.faces.length; f += 3) {
      const corners = [0, 1, 2].map((i) => now.features[what.faces[f + i]]);
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
    const { pen, seen } = view;
    now.features.forEach((v, j) => {
      if (!known(v)) return;
      const [x, y] = seen(v), looks = now.state[j];
      pen.beginPath(); pen.arc(x, y, 4, 0, 7);
      pen.fillStyle = looks === "2" ? colour.c3 : looks === "1" ? colour.ink : colour.paper;
      pen.strokeStyle = looks === "2" ? colour.c3 : looks === "1" ? colour.ink : colour.soft;
      pen.lineWidth = 1.2; pen.fill(); pen.stroke();
      view.marks.push([x, y, 4]);
    });
  }

  function names(view) {
    now.features.forEach((v, j) => {
      if (known(v)) view.words.push({ text: shortened(what.labels[j], NAME), at: view.seen(v), paint: colour.soft, gap: 7 });
    });
  }

  function orbitAxes(view) {
    const R = fromQuaternion(...now.orbit), size = (state.view === 0 ? 0.75 : 0.3) * radius();
    ["radial", "along-track", "cross-track"].forEach((name, column) => {
      const end = view.seen([R[column] * size, R[3 + column] * size, R[6 + column] * size]);
      line(view, view.seen([0, 0, 0]), end, colour.c2, 1.4);
      view.words.push({ text: name, at: end, paint: colour.c2, gap: 4 });
    });
  }

  function ghostly(view, { offset, covariance }, index) {
    const { pen, seen, scale, V } = view, paint = paintOf(index);
    if (!known(offset)) return;
    const [x, y] = seen(offset);
    if (known(covariance)) {
      const { long, short, angle } = outline(turnedCovariance(V, covariance));
      pen.beginPath(); pen.ellipse(x, y, Math.max(3 * long * scale, 0.5), Math.max(3 * short * scale, 0.5), -angle, 0, 2 * Math.PI);
      pen.globalAlpha = 0.16; pen.fillStyle = paint; pen.fill(); pen.globalAlpha = 1;
      pen.strokeStyle = paint; pen.lineWidth = 1.4; pen.stroke();
    }
    pen.beginPath(); pen.arc(x, y, 3.5, 0, 7); pen.fillStyle = paint; pen.fill();
    if (state.view === 2 && what.ghosts.length > 1) view.words.push({ text: what.ghosts[index].label, at: [x, y], paint, gap: 9 });
  }

  function centre(view) {
    const { pen, seen } = view, [x, y] = seen([0, 0, 0]);
    pen.strokeStyle = colour.ink; pen.lineWidth = 1.6;
    pen.beginPath(); pen.moveTo(x - 8, y); pen.lineTo(x + 8, y); pen.moveTo(x, y - 8); pen.lineTo(x, y + 8); pen.stroke();
  }

  function ruler(view) {
    const wide = view.width / 5 / view.scale, power = 10 ** Math.floor(Math.log10(wide));
    const size = [5, 2, 1].map((one) => one * power).find((one) => one <= wide), y = view.height - 16;
    line(view, [14, y], [14 + size * view.scale, y], colour.ink, 2);
    view.words.unshift({ text: length(size), at: [14, y], paint: colour.ink, gap: 0, places: [[1, -6]] });
  }

  function rotate(right, up) {
    camera.azimuth -= right;
    camera.elevation = Math.min(Math.max(camera.elevation + up, -Math.PI / 2), Math.PI / 2);
    redraw();
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
  canvas.addEventListener("wheel", (event) => {
    if (document.activeElement !== canvas && !event.ctrlKey) return;
    event.preventDefault();
    enlarge(1.0015 ** -event.deltaY);
  }, { passive: false });
  canvas.addEventListener("keydown", (event) => {
    const turns = { ArrowLeft: [-0.1, 0], ArrowRight: [0.1, 0], ArrowUp: [0, 0.1], ArrowDown: [0, -0.1] }[event.key];
    if (turns) rotate(...turns);
    else if (event.key === "+" || event.key === "=") enlarge(1.25);
    else if (event.key === "-") enlarge(0.8);
    else if (event.key === " ") what.toggle();
    else return;
    event.preventDefault();
  });
  new ResizeObserver(render).observe(canvas);
  for (const name of ["theme", "beforeprint", "afterprint"]) window.addEventListener(name, () => { colour = null; render(); });

  const tick = (text, name) => {
    const onchange = (event) => { camera[name] = event.currentTarget.checked; redraw(); };
    return el("label", {}, el("input", { type: "checkbox", checked: camera[name], onchange }), text);
  };
  const bigger = [["+", "enlarge", 1.25], ["−", "make smaller", 0.8]].map(([text, name, factor]) =>
    el("button", { type: "button", text, "aria-label": name, class: "only-screen", onclick: () => enlarge(factor) }));
  const legend = what.ghosts.map((ghost) => el("button", {
    type: "button", class: "key points", style: key(ghost.colour), text: ghost.label, "aria-pressed": String(ghost.shown),
    onclick: (event) => { ghost.shown = !ghost.shown; event.currentTarget.setAttribute("aria-pressed", String(ghost.shown)); what.changed(); },
  }));
  return {
    canvas,
    legend,
    controls: [
      choice("look at", VIEWS, (index) => { state.view = index; state.zoom = 1; render(); }, view),
      choice("in", what.axes, (index) => { camera.axes = index; redraw(); }, camera.axes),
      ...bigger, tick("shape", "shape"), tick("names", "names"), tick("trails", "trail"),
    ],
    show(moment) { now = moment; render(); },
  };
}
