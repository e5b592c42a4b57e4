// The page: a run that is stepped while it plays, its scene, its error, its numbers, and what can be changed.

const SPEEDS = [1, 3, 10, 30, 100];
const MOST_WORK = 10; // ms of stepping in a picture
const MOST_TIMED = 61; // pictures, of which the median is told
const RECENT = 100; // moments of an estimate's trail
const REFRESH = 250; // ms between two of chart and numbers
const MEANING = {
  waiting: "no frame yet with three features that are not in a line.",
  starting: "the target has not turned far enough to tell where its centre of mass is.",
  tracking: "position, velocity and covariance hold.",
  doubtful: "the residuals are larger than the noise that was told, or the path is rougher than it can be.",
  lost: "the last frame did not fit what is known of the features.",
};
const MOODS = { tracking: "good", doubtful: "bad", lost: "bad" };

async function live() {
  const data = JSON.parse(document.getElementById("data").textContent);
  const run = new Run(await unitsOf(data.modules), data);
  const state = { playing: null, speed: 10, wanted: 0, told: "", shown: 0 };
  const stepping = { ms: 0, steps: 0 }, drawing = []; // ms
  const error = { label: "error", x: [], y: [], low: [], high: [], colour: 5, style: "line", shown: true, of: null };
  const chart = {
    kind: "chart", title: "Error of the centre of mass", y_label: "error in m", x_label: "time in s", log: true, log_x: false, timed: false,
    series: [error], shades: [], shade: "", marks: [], levels: [], filter: [],
  };
  const drawn = chartOf(chart), ghosts = [{ label: "estimate", colour: 5, shown: true }];
  const seen = {
    labels: [], faces: [], reach: 1, ghosts, axes: Object.keys(AXES), first: 0, farthest: () => run.farthest,
    past: { count: () => run.kept.length, at: (k) => run.kept[k], recent: () => Math.max(0, run.kept.length - RECENT) }, toggle, changed: () => show(1),
  };
  const stage = Stage(seen), errors = Stage(seen, 2), settings = Settings(data, restart, (name, value) => attempt(() => run.tune("rig", name, value)));

  const reading = el("output", { class: "reading", "aria-live": "off" });
  const timing = el("p", { class: "soft timing" });
  const status = el("div", { class: "verdict", role: "status" });
  const numbers = el("dl", { class: "numbers" });
  const about = el("p", { class: "soft" });
  const play = el("button", { type: "button", class: "play", text: "▶ play", "aria-pressed": "false", onclick: toggle });
  const again = el("button", { type: "button", class: "again", text: "start again", onclick: restart });
  const speed = choice("speed", SPEEDS.map((one) => `${one} ×`), (index) => { state.speed = SPEEDS[index]; }, SPEEDS.indexOf(state.speed));

  // What a unit refuses is told, and nothing moves on.
  function attempt(work) {
    try {
      return work();
    } catch (refusal) {
      pause();
      tell("bad", "Refused.", refusal.message);
      return null;
    }
  }

  function tell(mood, heading, words) {
    if (state.told === heading + words) return;
    state.told = heading + words;
    status.className = `verdict ${mood}`;
    status.replaceChildren(el("b", { text: heading }), ` ${words}`);
  }

  function restart() {
    const { preset } = settings;
    Object.assign(seen, { labels: preset.labels, faces: preset.faces, reach: preset.reach });
    about.textContent = preset.description;
    state.wanted = 0;
    attempt(() => { run.start(preset, settings.values(), settings.connections()); refresh(); show(1); });
  }

  // share: of the way from the moment before to that of the last step.
  function show(share) {
    const begin = performance.now();
    const moment = between(run.before, run.now, share);
    for (const one of [stage, errors]) one.show(moment);
    drawing.push(performance.now() - begin);
    if (drawing.length > MOST_TIMED) drawing.shift();
  }

  function refresh() {
    const { kept, now } = run;
    Object.assign(error, {
      x: kept.map((one) => one.time),
      y: kept.map((one) => one.error),
      low: kept.map((one) => one.band[0]),
      high: kept.map((one) => one.band[1]),
    });
    chart.marks = run.marks;
    drawn.update();
    reading.textContent = [`t = ${timeText(now.time)} s`, ...wordsOf(now, seen.labels, ghosts)].join(" · ");
    tell(MOODS[now.status] || "warn", `${now.status}${now.tumbles ? ", tumble known" : ""}:`, MEANING[now.status]);
    numbers.replaceChildren(...numbersOf(run).flatMap(([name, value]) => [el("dt", { text: name }), el("dd", { text: value })]));
    const [step, picture] = [stepping.steps ? stepping.ms / stepping.steps : 0, [...drawing].sort((one, other) => one - other)[drawing.length >> 1] || 0];
    timing.textContent = `${step.toFixed(2)} ms for a step of the four units (${run.preset.step} s), ${picture.toFixed(2)} ms for a picture of the scene.`;
  }

  // Steps as long as there is something to do; older times count less.
  function stepWhile(more) {
    const begin = performance.now(), from = run.master.steps;
    while (more(performance.now() - begin)) run.step();
    const steps = run.master.steps - from;
    if (!steps) return;
    stepping.ms = 0.98 * stepping.ms + performance.now() - begin;
    stepping.steps = 0.98 * stepping.steps + steps;
  }

  // To the time that is wanted, or as far as a picture may take.
  function advance(seconds) {
    state.wanted += seconds;
    stepWhile((ms) => run.time < state.wanted && ms < MOST_WORK);
    state.wanted = Math.min(state.wanted, run.time);
  }

  function start() {
    let last = performance.now();
    play.textContent = "‖ pause"; play.setAttribute("aria-pressed", "true");
    const tick = (stamp) => {
      state.playing = requestAnimationFrame(tick);
      attempt(() => {
        advance((Math.min(Math.max(stamp - last, 0), 100) / 1e3) * state.speed);
        last = stamp;
        show(1 - (run.time - state.wanted) / run.preset.step);
        if (stamp - state.shown > REFRESH) { state.shown = stamp; refresh(); }
      });
    };
    state.playing = requestAnimationFrame(tick);
  }

  function pause() {
    if (state.playing !== null) cancelAnimationFrame(state.playing);
    state.playing = null;
    play.textContent = "▶ play"; play.setAttribute("aria-pressed", "false");
  }

  function toggle() {
    if (state.playing === null) start();
    else { pause(); refresh(); }
  }

  const part = (title, ...nodes) => el("section", { class: "part", "aria-label": title }, el("h2", { text: title }), ...nodes);
  const scene = part("Scene",
    el("div", { class: "controls", role: "group", "aria-label": "View" }, ...stage.controls, ...stage.legend),
    el("div", { class: "stages" }, stage.canvas, errors.canvas), reading,
    el("p", { class: "about", text: "The cross is the true centre of mass, the point with its 3σ ellipsoid the estimate, enlarged in a picture of its own. "
      + "Filled features are seen, hollow ones are not." }), timing);
  const curves = part("Error of the centre of mass",
    el("p", { class: "about", text: "95 % of errors are in the band, by the estimator's covariance." }), ...drawn.nodes);
  const found = part("The estimator", status, numbers);
  const chosen = part("Settings",
    el("p", { class: "about", text: "A change of the body or the orbit starts the run again." }),
    settings.node, el("div", { class: "controls" }, ...settings.buttons));
  document.getElementById("page").append(
    ...top("baryscope, live",
      "A tumbling target, a stereo rig, the online estimator and a controller: the C code of the FMUs in WebAssembly, stepped in this page.",
      "Skip to the scene"),
    el("main", { id: "main", class: "live" },
      el("div", { class: "bar" }, el("div", { class: "controls", role: "group", "aria-label": "Run" }, ...settings.choices, play, again, speed), about),
      el("div", {}, scene, curves), el("div", {}, found, chosen)),
    el("footer", {}, el("p", { class: "soft", text: `Made by baryscope ${data.version}. `
      + 'In the console, baryscope.units has the units by the names of their variables: baryscope.units.plant.get("target.attitude").' })),
  );
  settings.choose(data.first);
  // For the console: units by element, and some steps without waiting.
  window.baryscope = {
    units: run.units,
    get time() { return run.time; },
    step(count = 1) {
      pause();
      const end = run.master.steps + count;
      attempt(() => { stepWhile(() => run.master.steps < end); state.wanted = run.time; refresh(); show(1); });
    },
  };
  if (!window.matchMedia("(prefers-reduced-motion: reduce)").matches) start();
  document.documentElement.dataset.ready = "true";
}

// Truth and estimate in words: [name, value].
function numbersOf({ units: { plant, estimator, controller }, now }) {
  const rate = (unit) => `${shown(norm(unit.get("target.angularRate")) / DEGREE)} °/s`;
  const ratios = (inertia) => eigenvalues(inertia).map((one, _, all) => (one / (all[0] + all[1] + all[2])).toFixed(4)).join(" : ");
  const { offset, covariance } = now.ghosts[0], unknown = "not known yet";
  return [
    ["error", offset ? length(norm(offset)) : unknown],
    ["claimed", offset ? `±${length(deviation(covariance))}` : unknown],
    ["rate", rate(plant)],
    ["estimated", now.tumbles ? rate(estimator) : unknown],
    ["inertia ratios", ratios(INERTIA.map((axes) => plant.get(`target.inertia.${axes}`)[0]))],
    ["estimated", now.tumbles ? ratios(estimator.get("target.inertia")) : unknown],
    ["command", `${shown(1e3 * norm(controller.get("command.acceleration")))} mm/s²`],
  ];
}

live().catch((reason) => {
  document.getElementById("page").append(el("p", { role: "alert", text: `The units did not start: ${reason.message}` }));
});
