// The scene of a report: a stage whose time is chosen, and played smoothly from frame to frame.

function Scene(part) {
  const count = part.time.length, features = part.labels.length, lengths_of_play = [15, 60, 180];
  const state = { k: 0, playing: null, seconds: 60 };
  const triple = (flat, k) => [flat[3 * k], flat[3 * k + 1], flat[3 * k + 2]];
  const quaternion = (flat, k) => flat && flat.slice(4 * k, 4 * k + 4);

  function lastKnown(flat, k) {
    for (let j = k; j >= 0; j -= 1) if (flat[4 * j] !== null) return quaternion(flat, j);
    for (let j = k; j < count; j += 1) if (flat[4 * j] !== null) return quaternion(flat, j);
    return null;
  }

  // Without features, which trails don't need.
  const outlineOf = (k) => ({
    path: triple(part.path, k),
    attitude: part.attitude && lastKnown(part.attitude, k),
    orbit: quaternion(part.orbit, k),
    ghosts: part.ghosts.map(({ offset, covariance }) => ({ offset: triple(offset, k), covariance: covariance && covariance.slice(6 * k, 6 * k + 6) })),
  });
  const momentOf = (k) => ({ ...outlineOf(k), state: part.state[k], features: part.labels.map((_, j) => triple(part.features, k * features + j)) });

  const some = Array.from({ length: Math.min(count, 50) }, (_, j) => Math.floor((j * count) / Math.min(count, 50)));
  const reach = Math.max(...some.flatMap((k) => momentOf(k).features.filter(known).map(norm)), 0) || 1;
  let range = 0;
  for (let k = 0; k < count; k += 1) range = Math.max(range, norm(triple(part.path, k)));

  // How far an estimate is off, or claims to be, in the middle of its times: those that are much worse than the best
  // are hidden at first.
  function typical(index) {
    const sizes = some.map((k) => outlineOf(k).ghosts[index]).filter(({ offset }) => known(offset))
      .map(({ offset, covariance }) => Math.max(norm(offset), known(covariance) ? deviation(covariance) : 0));
    return sizes.sort((one, other) => one - other)[sizes.length >> 1] ?? Infinity;
  }
  const typicals = part.ghosts.map((_, index) => typical(index)), best = Math.min(...typicals);
  const ghosts = part.ghosts.map(({ label, colour }, index) => ({ label, colour, shown: typicals[index] <= 8 * best || typicals[index] === best }));
  const axes = ["inertial axes", ...(part.orbit ? ["LVLH axes"] : []), ...(part.attitude ? ["body axes"] : [])];

  const stage = Stage({
    labels: part.labels, faces: part.faces, ghosts, axes, first: part.orbit ? 1 : 0, reach, farthest: () => range,
    past: { count: () => count, at: outlineOf, recent: () => 0 }, toggle, changed: () => show(state.k),
  });
  const reading = el("output", { class: "reading scene-reading", "aria-live": "off" });
  const slid = () => { stop(); show(Number(slider.value)); clock.set(part.time[state.k]); };
  const slider = el("input", { type: "range", min: 0, max: count - 1, step: 1, value: 0, "aria-label": "Time", oninput: slid });
  const play = el("button", { type: "button", class: "play", text: "▶ play", "aria-pressed": "false", onclick: toggle });
  const pace = choice("all in", lengths_of_play.map((one) => `${one} s`), (index) => { state.seconds = lengths_of_play[index]; }, 1);

  function tell(k) {
    state.k = k;
    slider.value = k;
    const seconds = `${timeText(part.time[k])} s`;
    slider.setAttribute("aria-valuetext", seconds);
    reading.textContent = [`t = ${seconds}`, ...wordsOf(momentOf(k), part.labels, ghosts)].join(" · ");
  }

  function show(k) {
    tell(k);
    stage.show(momentOf(k));
  }

  function showAt(time) {
    const k = nearest(part.time, time), other = part.time[k] > time ? k - 1 : k + 1;
    if (k !== state.k) tell(k);
    if (other < 0 || other >= count) stage.show(momentOf(k));
    else {
      const [one, two] = k < other ? [k, other] : [other, k];
      stage.show(between(momentOf(one), momentOf(two), (time - part.time[one]) / (part.time[two] - part.time[one])));
    }
    clock.set(time);
  }

  function toggle() { if (state.playing === null) start(); else stop(); }

  function start() {
    play.textContent = "‖ pause"; play.setAttribute("aria-pressed", "true");
    const begin = part.time[0], end = part.time[count - 1];
    let last = performance.now(), time = state.k >= count - 1 ? begin : part.time[state.k];
    const tick = (stamp) => {
      if (!stage.canvas.offsetParent) { stop(); return; } // in a tab that is not shown any more
      time = Math.min(time + (Math.max(stamp - last, 0) / 1e3) * ((end - begin) / state.seconds), end);
      last = stamp;
      const gap = part.gaps.find((k) => part.time[k] < time && time < part.time[k + 1]);
      if (gap !== undefined) time = part.time[gap + 1]; // how it turned there nobody knows
      state.playing = requestAnimationFrame(tick);
      showAt(time);
      if (time >= end) stop();
    };
    state.playing = requestAnimationFrame(tick);
  }

  function stop() {
    if (state.playing !== null) cancelAnimationFrame(state.playing);
    state.playing = null;
    play.textContent = "▶ play"; play.setAttribute("aria-pressed", "false");
    stage.show(momentOf(state.k));
  }

  const meaning = `The cross is the ${part.path_label}; ellipsoids are 3σ; filled features are seen, hollow ones are not, red ones are rejected.`
    + (part.every > 1.01 ? ` One of ${Math.round(part.every * 10) / 10} frames is shown.` : "");
  show(0);
  clock.follow((time) => { const k = nearest(part.time, time); if (k !== state.k && state.playing === null) show(k); });
  return [
    el("p", { class: "about", text: meaning }),
    el("div", { class: "controls", role: "group", "aria-label": "View" }, ...stage.controls),
    el("div", { class: "controls", role: "group", "aria-label": "Estimates" }, ...stage.legend),
    stage.canvas,
    el("div", { class: "controls", role: "group", "aria-label": "Time" }, play, slider, pace),
    reading,
  ];
}
