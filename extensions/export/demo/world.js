// A graph with its simulated robot, tick by tick: its kernels are a module of WebAssembly (world.py), its physics
// MuJoCo's. It runs in a page and under Node.

/** Random numbers (xoshiro128**) by a seed: `uniform` from 0 to 1, `normal` of mean 0 and variance 1. */
export class Draws {
  constructor(seed) {
    this.state = new Uint32Array(4);
    for (let k = 0; k < 4; k += 1) { // splitmix32
      seed = (seed + 0x9e3779b9) | 0;
      let z = seed ^ (seed >>> 16);
      z = Math.imul(z, 0x21f0aaad);
      z ^= z >>> 15;
      z = Math.imul(z, 0x735a2d97);
      this.state[k] = z ^ (z >>> 15);
    }
  }

  uniform() {
    const s = this.state;
    const turned = Math.imul(s[1], 5);
    const drawn = Math.imul((turned << 7) | (turned >>> 25), 9) >>> 0;
    const shifted = s[1] << 9;
    s[2] ^= s[0]; s[3] ^= s[1]; s[1] ^= s[2]; s[0] ^= s[3]; s[2] ^= shifted;
    s[3] = (s[3] << 11) | (s[3] >>> 21);
    return (drawn + 0.5) / 4294967296;
  }

  normal() { // Box and Muller
    return Math.sqrt(-2 * Math.log(this.uniform())) * Math.cos(2 * Math.PI * this.uniform());
  }
}

/** Why a run has ended, by the status of a tick; `EVENT` is the score, which has judged, or the safety monitor. */
const EVENT = 1;

export class World {
  /**
   * @param mujoco MuJoCo's module
   * @param about what `NAME.json` says
   * @param compiled the compiled `NAME.wasm`
   * @param number which of the robots of `about`
   */
  static async make(mujoco, about, compiled, number, noise = 1) {
    const instance = await WebAssembly.instantiate(compiled, { env: Math });
    return new World(mujoco, about, instance.exports, number, noise);
  }

  constructor(mujoco, about, code, number, noise) {
    Object.assign(this, { mujoco, about, code, tick: 0, ended: "" });
    const { name, size } = about;
    const robot = about.robots[number];
    this.draws = new Draws(7919 * robot.seed + noise);
    this.self = Math.ceil(code.__heap_base.value / 64) * 64;
    const missing = this.self + size - code.memory.buffer.byteLength;
    if (missing > 0) code.memory.grow(Math.ceil(missing / 65536));
    const buffer = code.memory.buffer;
    if (code[`${name}_init`](this.self, BigInt(size)) !== 0) throw new Error(`${name} cannot begin`);
    const words = new BigInt64Array(buffer, this.self, size / 8);
    for (const [place, word] of robot.words) words[place] = BigInt(word);

    this.models = [];
    this.model = this.modelWith(robot);
    this.data = new mujoco.MjData(this.model);
    const integration = mujoco.mjtState.mjSTATE_INTEGRATION.value;
    mujoco.mj_setState(this.model, this.data, robot.state, integration);
    mujoco.mj_step1(this.model, this.data);

    this.arrays = {};
    for (const [key, [place, type, count]] of Object.entries(about.arrays)) {
      const kind = { float64: Float64Array, int64: BigInt64Array, uint8: Uint8Array }[type];
      this.arrays[key] = new kind(buffer, this.self + place, count);
    }
    const views = (fields) => Object.entries(fields).map(
      ([field, [place, count]]) => [field, new Float64Array(buffer, this.self + place, count)],
    );
    const to = views(about.to), from = views(about.from);
    const out = () => { for (const [field, own] of from) own.set(this.data[field]); };
    const simulate = ({ call, flags, arguments: more, when }) => {
      const model = this.modelWith(robot, flags);
      const wanted = when === null ? [1n] : new BigInt64Array(buffer, this.self + when, 1);
      const made = mujoco[call];
      return () => {
        if (!wanted[0]) return;
        for (const [field, own] of to) this.data[field].set(own);
        made(model, this.data, ...more);
        out();
      };
    };
    const call = (each) => {
      if (each.call) return simulate(each);
      if (typeof each !== "string") {
        const [kind, place, count] = each;
        const drawn = new Float64Array(buffer, this.self + place, count);
        return () => { for (let k = 0; k < count; k += 1) drawn[k] = this.draws[kind](); };
      }
      const made = code[`${name}_${each}`];
      return () => { if (made(this.self) !== 0) throw new Error(`${each} divides by zero`); };
    };
    this.programs = Object.fromEntries(
      Object.entries(about.programs).map(([key, program]) => [key, program.map(call)]),
    );
    out();
  }

  /** The robot's model, without what `flags` leave out. */
  modelWith(robot, flags = null) {
    const known = this.models.find((each) => flags === each.opt.disableflags);
    if (known) return known;
    const model = this.mujoco.MjModel.from_xml_string(this.about.xml);
    for (const [field, values] of Object.entries(robot.model)) model[field].set(values);
    if (flags !== null) model.opt.disableflags = flags;
    this.models.push(model);
    return model;
  }

  run(program) { for (const call of this.programs[program]) call(); }

  /** One tick of the graph; `force` [N, world] pushes the torso in it. Says whether the run goes on. */
  step(force = null) {
    if (this.ended) return false;
    this.run("read");
    const status = this.code[`${this.about.name}_step`](this.self, 0, 0);
    if (status < 0) this.ended = "a number is not finite";
    if (status === EVENT) this.ended = this.blockName();
    if (force) this.arrays.push.set(force);
    this.run("send");
    this.run("clear");
    this.run("advance");
    this.tick += 1;
    return !this.ended;
  }

  get time() { return this.tick * this.about.period; }

  /** The block that asked for the end of the run. */
  blockName() {
    const bytes = new Uint8Array(this.code.memory.buffer);
    const name = this.about.name;
    let place = this.code[`${name}_block_name`](this.code[`${name}_last_block`](this.self));
    let text = "";
    for (; bytes[place]; place += 1) text += String.fromCharCode(bytes[place]);
    return text;
  }

  free() { this.data.delete(); for (const model of this.models) model.delete(); }
}
