// Sliders: what each is called, between which values it goes, and how its value is put into words.

const DEGREE = Math.PI / 180;
const FASTEST = 20 * DEGREE; // rad/s
const INERTIA = ["xx", "yy", "zz", "xy", "xz", "yz"];
const MOMENTS = [0.2, 3]; // of the preset's smallest and largest moment
const ORBITS = [6.5e6, 4.3e7]; // m, semi-major axis
const STRICTLY = 1e-6; // what is kept from the edge of what a body or an orbit can be

const clamped = (value, low, high) => Math.min(Math.max(value, low), high);
const grouped = (value) => Number(value.toPrecision(4)).toLocaleString("en", { maximumFractionDigits: 6 }).replaceAll(",", " ");

// one: { name, unit, low, high, log, scale, step, get, set }; scale: of the unit that is shown in SI; changed: told after set.
function Slider(one, changed) {
  const scale = one.scale || 1, [low, high] = [one.low / scale, one.high / scale].map((value) => (one.log ? Math.log(value) : value));
  const input = el("input", {
    type: "range", min: low, max: high, step: one.log ? "any" : one.step, "aria-label": one.spoken || one.name,
    oninput: () => { const given = Number(input.value); one.set(scale * (one.log ? Math.exp(given) : given)); changed(); },
  });
  // "any" has steps of the browser's own by keys: a hundredth of the way instead.
  input.addEventListener("keydown", (event) => {
    const way = { ArrowLeft: -1, ArrowDown: -1, ArrowRight: 1, ArrowUp: 1 }[event.key];
    if (!way || !one.log) return;
    event.preventDefault();
    input.value = Number(input.value) + (way * (high - low)) / 100;
    input.dispatchEvent(new Event("input"));
  });
  const output = el("output", {});
  function refresh() {
    const value = one.get() / scale, text = `${grouped(value)}${one.unit}`;
    input.value = one.log ? Math.log(value) : value;
    input.setAttribute("aria-valuetext", text);
    output.textContent = text;
  }
  refresh();
  return { node: el("label", { class: "slider" }, el("span", { text: one.name }), input, output), refresh };
}

// A moment of inertia that a body can have beside two others: none is larger than the sum of the others.
function possibleMoment(value, [one, other]) {
  return clamped(value, Math.abs(one - other) * (1 + STRICTLY) + STRICTLY * one, (one + other) * (1 - STRICTLY));
}

// R diag(moments) Rᵀ by the names of its elements.
function tensor(R, moments) {
  const J = product(product(R, [moments[0], 0, 0, 0, moments[1], 0, 0, 0, moments[2]]), transposed(R));
  return Object.fromEntries(INERTIA.map((axes, k) => [axes, J[[0, 4, 8, 1, 2, 5][k]]]));
}

// The groups of sliders over what is chosen, for a preset: [legend, note, sliders, whether they start the run again].
function slidersOf(preset, chosen, ground) {
  const others = (k) => [chosen.moments[(k + 1) % 3], chosen.moments[(k + 2) % 3]];
  const smallest = Math.min(...preset.moments), largest = Math.max(...preset.moments);
  const moment = (k) => ({
    name: "xyz"[k], spoken: `Principal moment of inertia near ${"xyz"[k]}`, unit: " kg m²", low: MOMENTS[0] * smallest, high: MOMENTS[1] * largest, log: true,
    get: () => chosen.moments[k], set: (value) => { chosen.moments[k] = possibleMoment(value, others(k)); },
  });
  const rate = (k) => ({
    name: "xyz"[k], spoken: `Angular rate about ${"xyz"[k]}`, unit: " °/s", low: -FASTEST, high: FASTEST, scale: DEGREE, step: 0.01,
    get: () => chosen.rate[k], set: (value) => { chosen.rate[k] = value; chosen.way = null; },
  });
  const whole = {
    name: "in all", spoken: "Angular rate in all", unit: " °/s", low: 0, high: Math.sqrt(3) * FASTEST, scale: DEGREE, step: 0.01,
    get: () => norm(chosen.rate),
    set: (value) => {
      chosen.way = chosen.way || (norm(chosen.rate) ? chosen.rate.map((part) => part / norm(chosen.rate)) : [1, 0, 0]);
      const most = FASTEST / Math.max(...chosen.way.map(Math.abs));
      chosen.rate = chosen.way.map((part) => part * Math.min(value, most));
    },
  };
  const orbit = [
    {
      name: "a", spoken: "Semi-major axis", unit: " km", low: ORBITS[0], high: ORBITS[1], log: true, scale: 1e3,
      get: () => chosen.axis, set: (value) => { chosen.axis = Math.max(value, (ground * (1 + STRICTLY)) / (1 - chosen.eccentricity)); },
    },
    {
      name: "e", spoken: "Eccentricity", unit: "", low: 0, high: 0.8, step: 0.0001,
      get: () => chosen.eccentricity, set: (value) => { chosen.eccentricity = clamped(value, 0, 1 - (ground * (1 + STRICTLY)) / chosen.axis); },
    },
  ];
  const share = (name, spoken, field, high) => ({
    name, spoken, unit: " %", low: 0, high, scale: 0.01, step: 0.5, get: () => chosen.rig[field][0], set: (value) => { chosen.rig[field] = [value]; },
  });
  const sight = [
    {
      name: "noise", spoken: "Noise of a pixel coordinate", unit: " px", low: 0, high: 5, step: 0.05,
      get: () => chosen.rig["camera.pixelNoise"][0], set: (value) => { chosen.rig["camera.pixelNoise"] = [value]; },
    },
    share("blunders", "Share of blunders", "outliers.share", 0.3),
    share("missed", "Share of missed observations", "dropout", 0.9),
    {
      name: "seen to", spoken: "Largest angle between a feature's normal and the line of sight", unit: "°",
      low: 60 * DEGREE, high: Math.PI, scale: DEGREE, step: 1,
      get: () => chosen.rig["visibility.maxIncidence"][0], set: (value) => { chosen.rig["visibility.maxIncidence"] = [value]; },
    },
  ];
  return [
    ["Principal moments of inertia", "None can exceed the sum of the others.", [0, 1, 2].map(moment), true],
    ["Angular rate at the start, body axes", "", [whole, ...[0, 1, 2].map(rate)], true],
    ["Orbit", "Its periapsis stays above the ground.", orbit, true],
    ["The cameras, as the run goes on", "Seen to 180°: through the body.", sight, false],
  ];
}
