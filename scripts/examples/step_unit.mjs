// Step the unit in WebAssembly: under Node as here, or in a page with fetch() in place of readFileSync().
//
//     baryscope build --platforms wasm -o target.wasm
//     node scripts/examples/step_unit.mjs target.wasm [STEPS [SECONDS]]
//
// Prints every output after STEPS steps of SECONDS each, a line for each scalar. What it imports is one file, unit.mjs.

import { readFileSync } from "node:fs";

import { Unit } from "../../fmu/runtime/unit.mjs";

const [path, steps = "600", seconds = "0.1"] = process.argv.slice(2);
if (!path?.endsWith(".wasm")) {
  console.error("usage: node scripts/examples/step_unit.mjs UNIT.wasm [STEPS [SECONDS]]");
  process.exit(2);
}
const table = JSON.parse(readFileSync(path.replace(/\.wasm$/, ".json"), "utf8"));
const unit = await Unit.of(readFileSync(path), table);
unit.start();
for (let i = 0; i < Number(steps); i++) unit.step(Number(seconds));
for (const { name, kind } of table.variables) {
  if (kind === "output") unit.get(name).forEach((value, i) => console.log(`${name} ${i} ${value}`));
}
