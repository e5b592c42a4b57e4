// Step the unit in WebAssembly: under Node as here, or in a page with fetch() in place of readFileSync().
//
//     baryscope build --platforms wasm -o target.wasm
//     node scripts/examples/step_unit.mjs target.wasm [STEPS [SECONDS]]
//
// Prints every output after STEPS steps of SECONDS each, a line for each scalar.

import { readFileSync } from "node:fs";

const OK = 0;

class Unit {
  constructor(module, table) {
    this.c = new WebAssembly.Instance(module).exports; // the module asks for nothing
    this.c._initialize();
    this.variables = new Map(table.variables.map((variable) => [variable.name, variable]));
    this.component = this.c.unit_instantiate();
    if (!this.component) throw new Error("no memory for the unit");
    this.time = this.rest = 0;
    this.check(this.c.fmi2SetupExperiment(this.component, 0, 0, this.time, 0, 0));
    this.check(this.c.fmi2EnterInitializationMode(this.component));
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

  get(name) {
    return this.#exchange(name, (references, size, values, numbers) => {
      this.check(this.c.fmi2GetReal(this.component, references, size, values));
      return Array.from(numbers());
    });
  }

  set(name, values) {
    this.#exchange(name, (references, size, pointer, numbers) => {
      numbers().set(values);
      this.check(this.c.fmi2SetReal(this.component, references, size, pointer));
    });
  }

  // Lends the unit's memory for the references and values of a variable, row by row. `numbers` is asked for after a
  // call, since memory that grows leaves older views behind.
  #exchange(name, work) {
    const variable = this.variables.get(name);
    if (!variable) throw new Error(`${name}: not a variable of the unit`);
    const size = variable.shape.reduce((product, extent) => product * extent, 1);
    const values = this.c.malloc(12 * size);
    const references = values + 8 * size;
    new Uint32Array(this.c.memory.buffer, references, size).set(Array.from({ length: size }, (_, i) => variable.reference + i));
    try {
      return work(references, size, values, () => new Float64Array(this.c.memory.buffer, values, size));
    } finally {
      this.c.free(values);
    }
  }

  check(status) {
    if (status === OK) return;
    const bytes = new Uint8Array(this.c.memory.buffer);
    const begin = this.c.unit_message();
    throw new Error(new TextDecoder().decode(bytes.subarray(begin, bytes.indexOf(0, begin))));
  }
}

const [path, steps = "600", seconds = "0.1"] = process.argv.slice(2);
const table = JSON.parse(readFileSync(path.replace(/\.wasm$/, ".json"), "utf8"));
const unit = new Unit(new WebAssembly.Module(readFileSync(path)), table);
unit.start();
for (let i = 0; i < Number(steps); i++) unit.step(Number(seconds));
for (const { name, kind } of table.variables) {
  if (kind === "output") unit.get(name).forEach((value, i) => console.log(`${name} ${i} ${value}`));
}
