// What the reader chooses, and the values and connections of the chain that follow from it.

const CHASER = ["holds its place", "approaches a feature", "drifts freely"];
const TUNED = ["camera.pixelNoise", "outliers.share", "dropout", "visibility.maxIncidence"];

// data: of the page; start: told when the run has to start again; tune: told (name, value) of the rig while it runs.
function Settings(data, start, tune) {
  const groups = el("div", { class: "groups" });
  let preset = data.presets[0], chosen = null, sliders = [];

  function choose(index) {
    preset = data.presets[index];
    const { plant, rig } = preset.values;
    chosen = {
      moments: [...preset.moments],
      rate: [...plant["target.angularRate0"]],
      way: null, // of the rate, kept while it is 0
      axis: plant["orbit.semiMajorAxis"][0],
      eccentricity: plant["orbit.eccentricity"][0],
      rig: Object.fromEntries(TUNED.map((name) => [name, rig[name]])),
      chaser: chosen ? chosen.chaser : 0,
      seed: rig.seed[0],
    };
    sliders = [];
    groups.replaceChildren(...slidersOf(preset, chosen, data.ground).map(group));
    start();
  }

  function group([legend, note, specs, again]) {
    const own = specs.map((spec) => Slider(spec, () => { sliders.forEach((one) => one.refresh()); changed(again); }));
    sliders.push(...own);
    return el("fieldset", {}, el("legend", { text: legend }), ...own.map((one) => one.node), ...(note ? [el("p", { class: "soft", text: note })] : []));
  }

  function changed(again) {
    if (again) start();
    else for (const name of TUNED) tune(name, chosen.rig[name]);
  }

  // The parameters by element and name. One of the same name is the same in all units.
  function values() {
    const found = structuredClone(preset.values), everywhere = (name, value) => {
      for (const own of Object.values(found)) if (name in own) own[name] = value;
    };
    if (chosen.moments.some((value, k) => value !== preset.moments[k])) {
      for (const [axes, value] of Object.entries(tensor(preset.axes, chosen.moments))) everywhere(`target.inertia.${axes}`, [value]);
    }
    everywhere("target.angularRate0", chosen.rate);
    everywhere("orbit.semiMajorAxis", [chosen.axis]);
    everywhere("orbit.eccentricity", [chosen.eccentricity]);
    Object.assign(found.rig, chosen.rig, { seed: [chosen.seed] });
    found.controller.synchronised = [Number(chosen.chaser === 1)];
    return found;
  }

  const connections = () => preset.connections.filter(([, output]) => chosen.chaser !== 2 || output !== "command.acceleration");
  const presets = choice("preset", data.presets.map((one) => one.name), choose, data.first);
  const chaser = choice("the chaser", CHASER, (index) => { chosen.chaser = index; start(); });
  return {
    choices: [presets, chaser],
    node: groups,
    buttons: [
      el("button", { type: "button", text: "as in the preset", onclick: () => choose(data.presets.indexOf(preset)) }),
      el("button", { type: "button", text: "other noise", onclick: () => { chosen.seed += 1; start(); } }),
    ],
    choose,
    get preset() { return preset; },
    values,
    connections,
  };
}
