// A run: the chain of a preset, stepped, and what is kept of it.

const MOST_KEPT = 800; // moments; from there on every second one is dropped, and half as many are added

async function unitsOf(modules) {
  const made = Object.entries(modules).map(async ([element, { code, table }]) => [element, await Unit.of(await unpacked(code), table)]);
  return Object.fromEntries(await Promise.all(made));
}

// The bytes of a gzip file in base 64.
async function unpacked(code) {
  const bytes = Uint8Array.from(atob(code), (one) => one.charCodeAt(0));
  return new Response(new Blob([bytes]).stream().pipeThrough(new DecompressionStream("gzip"))).arrayBuffer();
}

// The 2.5 % and 97.5 % quantiles of the length of an error, from the upper triangle of its covariance, as expected_error of
// baryscope.report.charts has them; band: those of the root of χ² over degrees of freedom.
function expectedError([xx, xy, xz, yy, yz, zz], { degrees, low, high }) {
  const mean = xx + yy + zz, squares = xx * xx + yy * yy + zz * zz + 2 * (xy * xy + xz * xz + yz * yz);
  if (!(mean > 0)) return [0, 0];
  const first = degrees[0], step = degrees[1] - first, at = ((mean * mean) / squares - first) / step;
  const k = Math.min(Math.max(Math.floor(at), 0), degrees.length - 2), share = Math.min(Math.max(at - k, 0), 1);
  return [low, high].map((table) => Math.sqrt(squares / mean) * (table[k] + share * (table[k + 1] - table[k])));
}

// The eigenvalues of a symmetric matrix, the smallest first (Smith 1961).
function eigenvalues([xx, yy, zz, xy, xz, yz]) {
  const q = (xx + yy + zz) / 3, [a, b, c] = [xx - q, yy - q, zz - q];
  const p = Math.sqrt((a * a + b * b + c * c + 2 * (xy * xy + xz * xz + yz * yz)) / 6);
  if (p === 0) return [q, q, q];
  const determinant = a * (b * c - yz * yz) - xy * (xy * c - yz * xz) + xz * (xy * yz - b * xz);
  const angle = Math.acos(Math.min(Math.max(determinant / (2 * p ** 3), -1), 1)) / 3;
  const largest = q + 2 * p * Math.cos(angle), smallest = q + 2 * p * Math.cos(angle + (2 * Math.PI) / 3);
  return [smallest, 3 * q - largest - smallest, largest];
}

class Run {
  constructor(units, data) {
    this.units = units;
    this.statuses = data.statuses;
    this.band = data.band;
  }

  // Begin at time 0 with values by element and name, and the connections that hold.
  start(preset, values, connections) {
    this.preset = preset;
    this.master = new Master(this.units, connections, preset.step);
    this.master.start(values);
    this.kept = [];
    this.stride = 1;
    this.marks = [];
    this.farthest = 0;
    [this.anomaly] = this.units.plant.get("orbit.trueAnomaly");
    this.before = this.now = this.#moment();
    this.#keep();
  }

  get time() {
    return this.master.time;
  }

  step() {
    this.master.step();
    [this.before, this.now] = [this.now, this.#moment()];
    this.#keep();
  }

  // Change a tunable parameter in the run.
  tune(element, name, value) {
    this.units[element].set(name, value);
  }

  #moment() {
    const { plant, rig, estimator } = this.units, count = this.preset.labels.length;
    const path = plant.get("target.position"), flat = plant.get("features", 3 * count);
    const half = (plant.get("orbit.trueAnomaly")[0] - this.anomaly) / 2;
    const status = this.statuses[estimator.get("status")[0]], knows = status !== "waiting";
    const offset = knows ? minus(estimator.get("target.position"), path) : null;
    const covariance = knows ? estimator.get("target.positionCovariance") : null;
    return {
      time: this.time,
      path,
      features: this.preset.labels.map((_, j) => minus(flat.slice(3 * j, 3 * j + 3), path)),
      state: rig.get("seen", count).join(""),
      attitude: plant.get("target.attitude"),
      orbit: quaternionProduct(this.preset.lvlh, [Math.cos(half), 0, 0, Math.sin(half)]),
      ghosts: [{ offset, covariance }],
      status,
      tumbles: estimator.get("tumble.known")[0] === 1,
      error: knows ? norm(offset) : null,
      band: knows ? expectedError(covariance, this.band) : [null, null],
    };
  }

  #keep() {
    const { now } = this, first = (words, holds) => {
      if (holds && !this.marks.some(([, known]) => known === words)) this.marks.push([now.time, words]);
    };
    this.farthest = Math.max(this.farthest, norm(now.path));
    first("tracking", now.status === "tracking");
    first("tumble known", now.tumbles);
    if (this.master.steps % this.stride) return;
    this.kept.push(now);
    if (this.kept.length <= MOST_KEPT) return;
    this.kept = this.kept.filter((_, k) => k % 2 === 0);
    this.stride *= 2;
  }
}
