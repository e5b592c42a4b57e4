// A master for units in WebAssembly, as master.py is for FMUs: all step at once, then outputs become inputs (Jacobi).

export class Master {
  // units: by their elements' names; stepSize: of all steps, s.
  // connections: [element, output, element, input, count], of which the first `count` scalars are handed on.
  constructor(units, connections, stepSize) {
    Object.assign(this, { units, connections, stepSize });
  }

  // Begin at time 0 with values by element and name; what is not among them is as the modules have it.
  start(values) {
    for (const [element, unit] of Object.entries(this.units)) {
      unit.reset();
      for (const [name, value] of Object.entries(values[element] || {})) unit.set(name, value);
      unit.start();
    }
    this.steps = 0;
    this.#exchange();
  }

  get time() {
    return this.steps * this.stepSize;
  }

  step() {
    for (const unit of Object.values(this.units)) unit.step(this.stepSize);
    this.steps += 1;
    this.#exchange();
  }

  // All outputs are read before any input is set.
  #exchange() {
    const values = this.connections.map(([element, output, , , count]) => this.units[element].get(output, count));
    this.connections.forEach(([, , element, input], k) => this.units[element].set(input, values[k]));
  }
}
