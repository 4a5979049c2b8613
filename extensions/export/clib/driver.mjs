// Runs a library in WebAssembly on the inputs of many ticks; see driver.c.
import { closeSync, openSync, readFileSync, writeSync } from "node:fs";

const [file, name, memorySize, inputSize, outputSize, given, found] = process.argv.slice(2);
const [size, taken, made] = [memorySize, inputSize, outputSize].map(Number);
const env = Object.assign(Object.create(Math), { fmod: (a, b) => a % b });
const { instance } = await WebAssembly.instantiate(readFileSync(file), { env });
const own = instance.exports;
const memory = Math.ceil(own.__heap_base.value / 64) * 64;
const inputs = memory + Math.ceil(size / 64) * 64;
const outputs = inputs + Math.ceil(taken / 64) * 64;
const missing = outputs + made - own.memory.buffer.byteLength;
if (missing > 0) own.memory.grow(Math.ceil(missing / 65536));
const bytes = new Uint8Array(own.memory.buffer);
if (own[`${name}_init`](memory, BigInt(size)) !== 0) process.exit(3);
const all = readFileSync(given);
const to = openSync(found, "w");
for (let first = 0; first < all.length; first += taken) {
  bytes.set(all.subarray(first, first + taken), inputs);
  own[`${name}_step`](memory, inputs, outputs);
  writeSync(to, bytes, memory, size);
}
closeSync(to);
