// A unit in WebAssembly, stepped by the names of its variables: in a browser, under Node, wherever there is WebAssembly.
// `baryscope build --platforms wasm` writes the module and, in JSON, the table of its variables.

const OK = 0;

export class Unit {
  // The unit of a module's bytes and its table. It waits for parameters, then start().
  static async of(bytes, table) {
    const { instance } = await WebAssembly.instantiate(bytes);
    return new Unit(instance, table);
  }

  constructor(instance, table) {
    this.c = instance.exports; // the module asks for nothing
    this.c._initialize();
    this.table = table;
    this.variables = new Map(table.variables.map((variable) => [variable.name, variable]));
    this.lent = new Map();
    this.component = this.c.unit_instantiate();
    if (!this.component) throw new Error("no memory for the unit");
    this.#setUp();
  }

  #setUp() {
    this.time = this.rest = 0;
    this.check(this.c.fmi2SetupExperiment(this.component, 0, 0, this.time, 0, 0));
    this.check(this.c.fmi2EnterInitializationMode(this.component));
  }

  // Back to before start(), with all variables as the module has them.
  reset() {
    this.check(this.c.fmi2Reset(this.component));
    this.#setUp();
  }

  start() {
    this.check(this.c.fmi2ExitInitializationMode(this.component));
  }

  step(seconds) {
    this.check(this.c.fmi2DoStep(this.component, this.time, seconds, 1));
    const time = this.time + (seconds + this.rest); // compensated, so that ten thousand tenths are a thousand
    this.rest += seconds - (time - this.time);
    this.time = time;
  }

  // The first `count` scalars of a variable, row by row; all unless told. Booleans are 0 and 1.
  get(name, count = this.sizeOf(name)) {
    const { boolean, references, values } = this.#memory(name);
    const read = boolean ? this.c.fmi2GetBoolean : this.c.fmi2GetReal;
    this.check(read(this.component, references, count, values));
    return Array.from(this.#view(boolean, values, count));
  }

  // Set the first scalars of a variable, as many as there are values.
  set(name, given) {
    const { boolean, references, values } = this.#memory(name);
    if (given.length > this.sizeOf(name)) throw new Error(`${name}: found ${given.length} values, expected at most ${this.sizeOf(name)}`);
    this.#view(boolean, values, given.length).set(given);
    const write = boolean ? this.c.fmi2SetBoolean : this.c.fmi2SetReal;
    this.check(write(this.component, references, given.length, values));
  }

  has(name, kind) {
    return this.variables.get(name)?.kind === kind;
  }

  sizeOf(name) {
    return this.#known(name).shape.reduce((product, extent) => product * extent, 1);
  }

  #known(name) {
    const variable = this.variables.get(name);
    if (!variable) throw new Error(`${name}: not a variable of ${this.table.model}`);
    return variable;
  }

  // Memory of the unit for the values and references of a variable, row by row; taken once, and kept.
  #memory(name) {
    if (!this.lent.has(name)) {
      const { reference, boolean } = this.#known(name), size = this.sizeOf(name);
      const values = this.c.malloc(12 * size), references = values + 8 * size;
      new Uint32Array(this.c.memory.buffer, references, size).set(Array.from({ length: size }, (_, i) => reference + i));
      this.lent.set(name, { boolean, references, values });
    }
    return this.lent.get(name);
  }

  // Made anew for each call, since memory that grows leaves older views behind.
  #view(boolean, values, count) {
    return new (boolean ? Int32Array : Float64Array)(this.c.memory.buffer, values, count);
  }

  check(status) {
    if (status === OK) return;
    const bytes = new Uint8Array(this.c.memory.buffer);
    const begin = this.c.unit_message();
    throw new Error(new TextDecoder().decode(bytes.subarray(begin, bytes.indexOf(0, begin))));
  }
}
