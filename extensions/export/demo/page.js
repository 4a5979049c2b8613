// The page: a jump in three dimensions, pushes by the mouse, plots. world.js runs the robot.
import * as THREE from "three";
import { OrbitControls } from "three/addons/OrbitControls.js";
import loadMujoco from "@mujoco/mujoco";
import { World } from "./world.js";

const BLOW = 0.01, LONGEST = 1.2; // s that a push lasts; N s of the hardest
const PAPERS = 0.7; // N s of the paper's push: 70 N for 10 ms
const PER_METRE = 2.5; // N s of a push by how far the mouse was dragged
const FLIGHT = 3, NEVER = -1; // a phase; what the score writes where something has not happened
const query = new URLSearchParams(location.search);
const byId = (name) => document.getElementById(name);
const form = byId("settings"), fields = form.elements;

/** A file that is compressed, or that the server has decompressed already. */
async function bytesOf(file) {
  const answer = await fetch(file);
  if (!answer.ok) throw new Error(`${file}: ${answer.status}`);
  const bytes = new Uint8Array(await answer.arrayBuffer());
  if (bytes[0] !== 0x1f || bytes[1] !== 0x8b) return bytes;
  const stream = new Blob([bytes]).stream().pipeThrough(new DecompressionStream("gzip"));
  return new Uint8Array(await new Response(stream).arrayBuffer());
}

const jumps = await (await fetch("jumps.json")).json();
const mujoco = await loadMujoco({ wasmBinary: await bytesOf("mujoco.wasm.z") });
const loaded = {};

async function load(name) {
  loaded[name] ??= (async () => ({
    about: JSON.parse(new TextDecoder().decode(await bytesOf(`${name}.json.z`))),
    compiled: await WebAssembly.compile(await bytesOf(`${name}.wasm.z`)),
  }))();
  return loaded[name];
}

/** A robot that stands and will be pushed in flight by `impulse` [N s] towards `angle` [deg]. */
async function makeWorld(name, robot, impulse = 0, angle = 0, noise = 1) {
  const { about, compiled } = await load(name);
  const world = await World.make(mujoco, about, compiled, robot, noise);
  const turn = (angle * Math.PI) / 180;
  world.arrays.blow.set([Math.cos(turn), Math.sin(turn), 0].map((part) => (part * impulse) / BLOW));
  return world;
}

function verdict(world) {
  const { fallen, forbidden, tilt } = world.arrays;
  const degrees = ((tilt[0] * 180) / Math.PI).toFixed(0);
  if (fallen[0] !== NEVER) return "it falls";
  if (forbidden[0] !== 0n) return "something other than its feet touches the ground";
  if (world.ended === "score") return `it lands and stands; the torso tilted by ${degrees} degrees`;
  return world.ended ? `it stops: ${world.ended}` : "";
}

// The scene

const canvas = byId("scene");
const renderer = new THREE.WebGLRenderer({ canvas, antialias: true });
const scene = new THREE.Scene();
const camera = new THREE.PerspectiveCamera(40, 1, 0.01, 20);
camera.up.set(0, 0, 1);
camera.position.set(1.1, -1.2, 0.65);
const controls = new OrbitControls(camera, canvas);
controls.target.set(0.05, 0, 0.28);
const dark = matchMedia("(prefers-color-scheme: dark)");
function colour() { scene.background = new THREE.Color(dark.matches ? 0x16181c : 0xf4f5f7); }
dark.addEventListener("change", colour);
colour();
scene.add(new THREE.HemisphereLight(0xffffff, 0x556070, 2));
const sun = new THREE.DirectionalLight(0xffffff, 2.2);
sun.position.set(1, -1.5, 3);
sun.castShadow = true;
renderer.shadowMap.enabled = true;
scene.add(sun);
const grid = new THREE.GridHelper(4, 40, 0x8a929c, 0xb6bcc4);
grid.rotation.x = Math.PI / 2;
scene.add(grid);

const PLANE = 0, SPHERE = 2, CAPSULE = 3, CYLINDER = 5, BOX = 6; // MuJoCo's kinds of shapes
const SIDES = { right: 0xd9822b, left: 0x3d7cc9 };
let parts = [];

function shapeOf(kind, size) {
  if (kind === SPHERE) return new THREE.SphereGeometry(size[0], 24, 16);
  if (kind === BOX) return new THREE.BoxGeometry(2 * size[0], 2 * size[1], 2 * size[2]);
  const made = kind === CYLINDER
    ? new THREE.CylinderGeometry(size[0], size[0], 2 * size[1], 24)
    : new THREE.CapsuleGeometry(size[0], 2 * size[1], 8, 24);
  return made.rotateX(Math.PI / 2); // along z, as MuJoCo has them
}

function build(world) {
  for (const part of parts) scene.remove(part.mesh);
  const { model, about } = world;
  parts = [];
  const add = (shape, color, number, of) => {
    const material = new THREE.MeshStandardMaterial({ color, roughness: 0.55, metalness: 0.1 });
    const mesh = new THREE.Mesh(shape, material);
    mesh.castShadow = true;
    mesh.matrixAutoUpdate = false;
    scene.add(mesh);
    parts.push({ mesh, number, of });
  };
  const drawn = new Set();
  for (const { body, corners, triangles, color } of about.looks) {
    const shape = new THREE.BufferGeometry();
    shape.setAttribute("position", new THREE.Float32BufferAttribute(corners, 3));
    shape.setIndex(triangles);
    shape.computeVertexNormals();
    const number = mujoco.mj_name2id(model, mujoco.mjtObj.mjOBJ_BODY.value, body);
    drawn.add(number);
    add(shape, color ?? 0x59636e, number, "body");
  }
  for (let k = 0; k < model.ngeom; k += 1) {
    const kind = model.geom_type[k];
    if (kind === PLANE || drawn.has(model.geom_bodyid[k])) continue;
    const size = model.geom_size.slice(3 * k, 3 * k + 3);
    const name = mujoco.mj_id2name(model, mujoco.mjtObj.mjOBJ_GEOM.value, k) ?? "";
    const side = Object.keys(SIDES).find((each) => name.startsWith(each));
    add(shapeOf(kind, size), side ? SIDES[side] : 0x59636e, k, "geom");
  }
}

const arrow = (hex) => {
  const made = new THREE.ArrowHelper(new THREE.Vector3(0, 0, 1), new THREE.Vector3(), 0.1, hex, 0.03, 0.02);
  made.visible = false;
  scene.add(made);
  return made;
};
const contacts = [0, 1, 2, 3].map(() => arrow(0x2e9e4f)), blowArrow = arrow(0xe0245e);

function point(helper, from, vector, scale) {
  const length = vector.length() * scale;
  helper.visible = length > 0.003;
  if (!helper.visible) return;
  helper.position.copy(from);
  helper.setDirection(vector.clone().normalize());
  helper.setLength(length, Math.min(0.03, 0.4 * length), Math.min(0.02, 0.3 * length));
}

function draw(world) {
  const { geom_xpos, geom_xmat, xpos, xmat } = world.data;
  for (const { mesh, number, of } of parts) {
    const [place, turn] = of === "body" ? [xpos, xmat] : [geom_xpos, geom_xmat];
    const [a, b] = [3 * number, 9 * number];
    mesh.matrix.set(
      turn[b], turn[b + 1], turn[b + 2], place[a], turn[b + 3], turn[b + 4], turn[b + 5], place[a + 1],
      turn[b + 6], turn[b + 7], turn[b + 8], place[a + 2], 0, 0, 0, 1,
    );
  }
  const { points, forces } = world.arrays;
  contacts.forEach((helper, k) => point(
    helper, new THREE.Vector3(...points.slice(3 * k, 3 * k + 3)),
    new THREE.Vector3(...forces.slice(3 * k, 3 * k + 3)), 0.004,
  ));
  const push = dragged ?? (showing > 0 ? shown : new THREE.Vector3());
  point(blowArrow, torso(world), push, 0.4);
}

function torso(world) {
  const { xipos } = world.data;
  return new THREE.Vector3(xipos[3], xipos[4], xipos[5]);
}

// Pushes by the mouse

window.pushes = []; // for tests: all that were given [N s, world]

let dragged = null, start = null, plane = null, blow = null, left = 0, shown = new THREE.Vector3(), showing = 0;
const ray = new THREE.Raycaster();

function under({ clientX, clientY }, aside = 0, below = 0) {
  const box = canvas.getBoundingClientRect();
  ray.setFromCamera(new THREE.Vector2(
    (2 * (clientX + aside - box.left)) / box.width - 1, 1 - (2 * (clientY + below - box.top)) / box.height,
  ), camera);
  return ray;
}

const NEAR = [[0, 0], ...[15, 30].flatMap((r) => [...Array(8).keys()].map((k) => [r * Math.cos((k * Math.PI) / 4), r * Math.sin((k * Math.PI) / 4)]))];
/** Whether the robot is within 30 px of the pointer: a finger is no needle. */
function hits(event) {
  const meshes = parts.map((part) => part.mesh);
  return NEAR.some(([aside, below]) => under(event, aside, below).intersectObjects(meshes).length);
}

function onPlane(event) {
  return under(event).ray.intersectPlane(plane, new THREE.Vector3());
}

canvas.addEventListener("pointerdown", (event) => {
  if (!world || !hits(event)) return;
  // level, at the torso's height when the drag begins: the robot moves on under the mouse
  plane = new THREE.Plane(new THREE.Vector3(0, 0, 1), -torso(world).z);
  start = onPlane(event);
  if (!start) return;
  controls.enabled = false;
  canvas.setPointerCapture(event.pointerId);
  dragged = new THREE.Vector3();
});
canvas.addEventListener("pointermove", (event) => {
  if (!event.buttons) canvas.style.cursor = world && hits(event) ? "crosshair" : "grab";
  const here = start && onPlane(event);
  if (here) dragged = here.sub(start).multiplyScalar(PER_METRE).clampLength(0, LONGEST);
});
canvas.addEventListener("pointerup", () => {
  controls.enabled = true;
  if (dragged && dragged.length() > 0.02) give(dragged);
  start = dragged = null;
});

/** Push the torso by an impulse [N s, world] from now on. */
function give(impulse) {
  blow = impulse.clone().divideScalar(BLOW);
  left = Math.round(BLOW / world.about.period);
  shown = impulse;
  showing = 60;
  window.pushes.push(impulse.toArray());
}

// Plots

const plots = [...document.querySelectorAll(".plot")];
let rows = [];

function note(world) {
  const { com, planned, forces, momentum, torque, phase, points } = world.arrays;
  const ground = points.length / 3 / 2; // contact points a foot
  const foot = (k) => {
    let sum = 0;
    for (let n = k * ground; n < (k + 1) * ground; n += 1) sum += forces[3 * n + 2];
    return sum;
  };
  rows.push({
    phase: Number(phase[0]), height: [com[2]], planned: [planned[2]], force: [foot(0), foot(1)],
    momentum: [...momentum], torque: [Math.max(...torque.map(Math.abs))],
  });
}

const COLOURS = { force: ["right", "left"], momentum: ["x", "y", "z"], height: ["phase"], torque: ["phase"] };
const colourOf = (name) => getComputedStyle(document.querySelector(`.${name}`)).color;
const SHADES = { 1: 0.05, 2: 0.16, 3: 0, 4: 0.16, 5: 0.05 }; // by the phase

/** The stretches of rows that have one phase. */
function bands() {
  const found = [];
  rows.forEach(({ phase }, k) => {
    const last = found[found.length - 1];
    if (last?.phase === phase) last.to = k;
    else found.push({ phase, from: Math.max(0, k - 1), to: k });
  });
  return found;
}

function plot(canvas2) {
  const of = canvas2.dataset.of, ratio = devicePixelRatio;
  const width = (canvas2.width = canvas2.clientWidth * ratio), height = (canvas2.height = canvas2.clientHeight * ratio);
  const pen = canvas2.getContext("2d");
  if (rows.length < 2) return;
  const values = rows.flatMap((row) => row[of]);
  let low = Math.min(...values), high = Math.max(...values);
  if (high - low < 1e-6) { low -= 0.5; high += 0.5; }
  const x = (k) => (k / (rows.length - 1)) * (width - 60 * ratio) + 50 * ratio;
  const y = (value) => height - 6 * ratio - ((value - low) / (high - low)) * (height - 16 * ratio);
  const ink = colourOf("phase");
  pen.fillStyle = ink;
  pen.font = `${11 * ratio}px system-ui`;
  for (const { phase, from, to } of bands()) { // each phase is one shade, so that nothing overlaps
    pen.globalAlpha = SHADES[phase] ?? 0;
    pen.fillRect(x(from), 0, x(to) - x(from), height);
    pen.globalAlpha = 0.75;
    const name = world.about.phases[phase];
    if (of === "height" && pen.measureText(name).width < x(to) - x(from) - 4 * ratio) pen.fillText(name, x(from) + 2 * ratio, 11 * ratio);
  }
  const period = world.about.period, seconds = rows.length * period;
  for (let mark = 0.5; mark < seconds; mark += 0.5) { // half seconds
    pen.globalAlpha = 0.15;
    pen.fillRect(x(mark / period), 0, ratio, height);
    pen.globalAlpha = 0.75;
    if (of === "torque" && mark % 1 === 0) pen.fillText(`${mark} s`, x(mark / period) + 3 * ratio, height - 4 * ratio);
  }
  pen.globalAlpha = 0.3;
  if (low < 0 && high > 0) pen.fillRect(50 * ratio, y(0), width, ratio);
  pen.globalAlpha = 1;
  const line = (value, dashed) => {
    pen.setLineDash(dashed ? [5 * ratio, 4 * ratio] : []);
    pen.beginPath();
    rows.forEach((row, k) => pen.lineTo(x(k), y(value(row))));
    pen.stroke();
  };
  pen.lineWidth = 1.4 * ratio;
  if (of === "height") { pen.strokeStyle = "gray"; line((row) => row.planned[0], true); }
  COLOURS[of].forEach((name, k) => { pen.strokeStyle = colourOf(name); line((row) => row[of][k], false); });
  pen.fillText(high.toPrecision(3), 2, 12 * ratio);
  pen.fillText(low.toPrecision(3), 2, height - 4 * ratio);
}

// Running

let world = null, before = 0, owed = 0, since = 0, stale = true;

async function begin() {
  const next = await makeWorld(
    fields.jump.value, Number(fields.robot.value), Number(fields.impulse.value), Number(fields.angle.value),
    Math.floor(1e6 * Math.random()) + 1,
  );
  world?.free();
  world = next;
  rows = [];
  blow = null;
  owed = showing = 0;
  build(world);
  byId("verdict").textContent = "";
}

function tick() {
  const force = left > 0 ? [blow.x, blow.y, blow.z] : null;
  left -= 1;
  const goesOn = world.step(force);
  const { push } = world.arrays;
  if (!force && Math.hypot(...push) > 0) { shown = new THREE.Vector3(...push).multiplyScalar(BLOW); showing = 60; }
  note(world);
  return goesOn && world.time < 8;
}

function frame(now) {
  requestAnimationFrame(frame);
  const box = canvas.parentElement;
  if (canvas.width !== Math.round(box.clientWidth * devicePixelRatio)
    || canvas.height !== Math.round(box.clientHeight * devicePixelRatio)) {
    renderer.setPixelRatio(devicePixelRatio);
    renderer.setSize(box.clientWidth, box.clientHeight, false);
    camera.aspect = box.clientWidth / box.clientHeight;
    camera.updateProjectionMatrix();
    stale = true;
  }
  const passed = Math.min(0.05, (now - before) / 1000);
  before = now;
  if (world && !world.ended) {
    const chosen = Number(fields.speed.value), phase = Number(world.arrays.phase[0]);
    const flies = phase === FLIGHT;
    owed += passed * (chosen < 0.1 && !flies ? 0.5 : chosen);
    while (owed >= world.about.period && tick()) owed -= world.about.period;
    byId("phase").textContent = `${world.about.phases[phase]}, ${world.time.toFixed(2)} s`;
    byId("verdict").textContent = verdict(world);
    since += 1;
    if (since % 4 === 0 || world.ended) plots.forEach(plot);
  }
  showing -= 1;
  if (controls.update() || stale || (world && !world.ended)) {
    if (world) draw(world);
    renderer.render(scene, camera);
  }
  stale = world && !world.ended;
}

for (const [name, text] of Object.entries(jumps)) fields.jump.add(new Option(text, name));
const DIRECTIONS = { 0: "ahead", 90: "left", 180: "back", 270: "right" };
function told() {
  const [impulse, angle] = [Number(fields.impulse.value), Number(fields.angle.value)];
  fields.size.value = impulse ? `${impulse.toFixed(2)} N s` : "none";
  fields.direction.value = DIRECTIONS[angle] ?? `${angle} deg`;
}
async function listRobots() {
  const { about } = await load(fields.jump.value);
  fields.robot.replaceChildren(...about.robots.map((robot, k) => new Option(`seed ${robot.seed}`, k)));
}
form.addEventListener("input", told);
fields.jump.addEventListener("change", async () => { await listRobots(); await begin(); });
fields.robot.addEventListener("change", begin);
form.addEventListener("submit", (event) => { event.preventDefault(); begin(); });

byId("push").addEventListener("click", () => {
  const turn = (Number(fields.angle.value) * Math.PI) / 180, size = Number(fields.impulse.value) || PAPERS;
  if (world && !world.ended) give(new THREE.Vector3(Math.cos(turn), Math.sin(turn), 0).multiplyScalar(size));
});

const speed = query.get("speed"), speeds = [...fields.speed.options].map((option) => option.value);
if (Number(speed) > 0 && !speeds.includes(speed)) fields.speed.add(new Option(`${speed} x real time`, speed));
for (const name of ["jump", "impulse", "angle", "speed"]) if (query.has(name)) fields[name].value = query.get(name);
told();
await listRobots();
if (query.has("robot")) fields.robot.value = query.get("robot");
await begin();
requestAnimationFrame(frame);

/** For tests: a run without pictures; its memory of signals and states, in base64, and how it ended. */
window.runAlone = async (name, robot, impulse, angle, noise) => {
  const alone = await makeWorld(name, robot, impulse, angle, noise);
  while (alone.time < 8 && alone.step());
  const text = (bytes) => btoa(Array.from(bytes, (byte) => String.fromCharCode(byte)).join(""));
  const { bus, state } = alone.arrays;
  const found = { ended: alone.ended, time: alone.time, bus: text(bus), state: text(state), verdict: verdict(alone) };
  alone.free();
  return found;
};
window.ready = true;
