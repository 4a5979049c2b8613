// The part of the page that belongs to a running graph; the page's own script and that of the charts have run before it.
const PERIOD = 250, SLOWER = 1000;
const badge = document.getElementById("state"), line = document.getElementById("line");
const svgName = "http://www.w3.org/2000/svg";

async function call(path, body) {
  const headers = {"X-Aloft-Token": data.live.token};
  if (body !== undefined) headers["Content-Type"] = "application/json";
  const answer = await fetch(path, {method: body === undefined ? "GET" : "POST", headers,
    body: body === undefined ? undefined : JSON.stringify(body)});
  const found = await answer.json();
  if (!answer.ok) throw new Error(found.error);
  return found;
}

// Numbers beside the outputs, times in the blocks, and wires that can be hit.
const beside = new Map(), took = new Map(), nodes = new Map();
function write(parent, x, y, kind, anchor) {
  const text = document.createElementNS(svgName, "text");
  text.setAttribute("x", x); text.setAttribute("y", y); text.setAttribute("class", kind);
  if (anchor) text.setAttribute("text-anchor", anchor);
  parent.append(text);
  return text;
}
for (const port of drawing.querySelectorAll(".port")) {
  const text = write(port.parentNode, +port.getAttribute("x") + 6, +port.getAttribute("y") - 1, "now");
  const name = port.dataset.port;
  beside.set(name, [...(beside.get(name) || []), text]);
}
for (const node of drawing.querySelectorAll(".node")) {
  nodes.set(node.dataset.path, node);
  if (!data.blocks[node.dataset.path]) continue;
  const box = node.querySelector("rect"), at = name => +box.getAttribute(name);
  took.set(node.dataset.path,
    write(node, at("x") + at("width") / 2, at("y") + at("height") - 2.5, "took", "middle"));
}
for (const wire of [...drawing.querySelectorAll(".wire[data-source]")]) {
  const hit = wire.cloneNode();
  hit.setAttribute("class", "hit");
  const title = document.createElementNS(svgName, "title");
  hit.append(title);
  const port = hit.dataset.source;
  hit.addEventListener("mouseenter", () => { title.textContent = [port, ...fieldsOf(port)].join("\n"); });
  hit.addEventListener("click", () => show(port.slice(0, port.lastIndexOf("."))));
  wire.after(hit);
}
function fieldsOf(port) {
  return Object.keys(now).filter(key => key.slice(0, key.lastIndexOf(".")) === port)
    .map(key => key.slice(port.length + 1) + ": " + now[key]);
}

// What the run is doing, a few times a second.
const words = {running: "running", paused: "paused", starting: "starting", still: "stands still", ended: "has ended",
  gone: "is gone", unheard: "not heard", partly: "in part", other: "another graph", lost: "this page's program has ended"};
function say(state, said) {
  badge.className = state; badge.textContent = words[state] || state;
  line.textContent = said;
}
let changes = -1;
const counted = new Map(), RECENT = 3000;
function lateLately(late) {
  const moment = performance.now();
  return Object.keys(late).filter(path => {
    const before = counted.get(path);
    if (!before || before.count !== late[path]) counted.set(path, {count: late[path], at: moment});
    return moment - counted.get(path).at < RECENT;
  });
}
// Of a graph on several machines: the state of each part, and what is said of it.
let parts = {};
const partLine = document.getElementById("parts");
const partOf = path => data.blocks[path] ? data.blocks[path].machine : "";
const absent = path => ["ended", "gone", "unheard"].includes((parts[partOf(path)] || [""])[0]);
function sayParts() {
  partLine.replaceChildren(...Object.entries(parts).map(([name, [state, said]]) => {
    const badge = make("span", name + " " + (words[state] || state), "part " + state);
    badge.title = said;
    return badge;
  }));
}
shown.push(path => {
  const [state, said] = parts[partOf(path)] || ["", ""];
  if (said) panel.append(make("p", partOf(path) + " " + said, "part " + state));
});
function draw(found) {
  now = found.values; times = {};
  for (const [path, text] of took) {
    const time = found.times[path];
    text.textContent = time ? time[0] + (found.late[path] ? ", late " + found.late[path] + "×" : "") : "";
    if (time) times[path] = time[1];
  }
  const late = lateLately(found.late);
  parts = found.parts || {};
  for (const [path, node] of nodes) node.classList.toggle("absent", absent(path));
  for (const [path, node] of nodes)
    node.classList.toggle("late", late.some(name => name === path || name.startsWith(path + "/")));
  for (const [port, texts] of beside) for (const text of texts) text.textContent = found.brief[port] || "";
  moment();
  if (found.changes !== changes) { changes = found.changes; refresh(); }
}
async function look() {
  let wait = charts.size ? CHART_PERIOD : PERIOD;
  try {
    const asked = [...charts.keys()].map(name => "chart=" + encodeURIComponent(name)).join("&");
    const found = await call("now?" + asked);
    if (found.state === "other") { location.reload(); return; }
    if (found.values) draw(found);
    if (found.charted) addSamples(found.tick * data.live.period, found.charted);
    if (found.control !== undefined) drawControl(found.control);
    if (pause) pause.disabled = found.state === "ended" || found.state === "gone";
    sayParts();
    say(found.state, [found.said, found.line].filter(Boolean).join("; "));
    if (found.state === "ended" || found.state === "gone") wait = SLOWER;
  } catch (error) { say("lost", String(error.message)); wait = SLOWER; }
  setTimeout(look, document.hidden ? SLOWER : wait);
}

// Pausing, and going back to a snapshot. The slider has a place for each; what it shows is asked for when it is let go.
const back = document.getElementById("back"), pause = document.getElementById("pause");
let standing = null;
const instant = tick => (tick * data.live.period).toFixed(3) + " s";
function drawControl(found) {
  if (!pause) return;
  const before = standing;
  standing = found;
  pause.textContent = !found ? "pause" : found.over ? "end the run" : "go on";
  document.getElementById("paused").hidden = !found;
  if (!found || JSON.stringify(before) === JSON.stringify(found)) return;
  back.min = 0; back.max = found.kept.length - 1; back.step = 1;
  const place = found.kept.filter(tick => tick <= found.tick).length - 1;
  document.getElementById("kept").replaceChildren(...found.kept.map((_, k) => new Option("", k)));
  back.value = place;
  target(found.kept[place]);
}
const target = tick => { document.getElementById("target").textContent = tick === undefined ? "" : instant(tick); };
async function control(body) {
  const refused = document.getElementById("refused");
  try { drawControl((found => found.paused ? found : null)(await call("control", body))); refused.textContent = ""; }
  catch (error) { refused.textContent = error.message; }
  refresh();
}
if (pause) {
  const length = document.getElementById("for");
  pause.onclick = () => {
    if (!standing) { control({do: "pause"}); return; }
    const text = length.value.trim(), seconds = /^(\d*\.?\d+) *s?$/.exec(text);
    if (text && !seconds) {
      document.getElementById("refused").textContent = "expected seconds, as 0.5, not " + text;
      return;
    }
    const number = standing.over || !text ? null : Math.max(1, Math.round(seconds[1] / data.live.period));
    control({do: "go on", number});
  };
  const rate = document.getElementById("rate");
  if (rate) rate.onchange = () => control({do: "play", number: +rate.value});
  back.oninput = () => target(standing.kept[back.value]);
  back.onchange = () => control({do: "back", number: standing.kept[back.value]});
}

// Parameters that can be changed.
const FEW_PARAMETERS = 12;
let tunables = [];
const boxes = new Map();
async function refresh() {
  if (!data.live.tuning) return;
  try { tunables = (await call("parameters")).parameters; } catch (error) { return; }
  for (const row of tunables) for (const box of boxes.get(row.path) || []) box(row);
}
function input(kind, value) {
  const made = document.createElement("input");
  if (kind) made.type = kind;
  made.value = value;
  return made;
}
const written = value => typeof value === "string" ? value : JSON.stringify(value);
function tunable(row) {
  const box = make("div", "", "tunable whole"), error = make("div", "", "error");
  box.dataset.path = row.path;
  const heading = document.createElement("div");
  heading.append(make("b", row.name));
  const about = [row.unit, row.bounds].filter(Boolean).join(", ");
  if (about) heading.append(" [" + about + "]");
  box.append(heading, make("div", row.text, "soft"));
  let busy = false, waiting = null;
  async function set(text) {
    if (busy) { waiting = text; return; }
    busy = true;
    try { await call("set", {settings: [row.path + "=" + text]}); error.textContent = ""; }
    catch (refused) { error.textContent = refused.message; }
    busy = false;
    if (waiting !== null) { const next = waiting; waiting = null; set(next); }
  }
  const fields = [], sliders = [];
  const parts = row.kind === "numbers" ? row.value.map((_, k) => k) : [null];
  const send = () => set(row.kind === "numbers" ? "[" + fields.map(f => f.value).join(", ") + "]" : fields[0].value);
  for (const k of parts) {
    const value = k === null ? row.value : row.value[k];
    const cell = make("div", "", "number");
    if (row.elements && row.elements.length > 1) cell.append(make("span", row.elements[k], "element"));
    if (row.kind === "choice") {
      const select = document.createElement("select");
      for (const choice of row.choices) select.append(new Option(choice, choice));
      select.value = written(value); select.onchange = send; fields.push(select); cell.append(select);
    } else {
      const field = input("", written(value));
      field.setAttribute("aria-label", row.path);
      field.onchange = send; fields.push(field); cell.append(field);
      if (row.kind === "text") field.className = "long";
      else {
        const slider = input("range", value);
        slider.setAttribute("aria-label", row.path + ", slider");
        slider.min = row.low; slider.max = row.high;
        slider.step = row.integer ? 1 : "any";
        slider.value = value;
        slider.oninput = () => { field.value = row.integer ? slider.value : String(+(+slider.value).toPrecision(4)); send(); };
        sliders.push(slider); field.before(slider);
      }
    }
    box.append(cell);
  }
  const foot = make("div", "", "soft");
  const back = make("button", "back to " + written(row.start));
  back.onclick = () => set(written(row.start));
  foot.append(row.place + " ", back);
  box.append(error, foot);
  function update(next) {
    box.classList.toggle("changed", written(next.value) !== written(next.start));
    back.hidden = written(next.value) === written(next.start);
    parts.forEach((k, index) => {
      const value = k === null ? next.value : next.value[k];
      if (document.activeElement !== fields[index]) fields[index].value = written(value);
      if (sliders[index] && document.activeElement !== sliders[index]) sliders[index].value = value;
    });
  }
  boxes.set(row.path, [...(boxes.get(row.path) || []), update]);
  update(row);
  return box;
}
shown.push(path => {
  boxes.clear();
  const mine = tunables.filter(row => row.block === path);
  if (!mine.length) return;
  panel.append(make("h2", "Tune"), ...mine.map(tunable));
});
function tuneAll() {
  chosen = ""; boxes.clear();
  panel.replaceChildren(make("h1", "Parameters"));
  const seek = input("search", "");
  seek.placeholder = "part of a name";
  const save = make("button", "write changed values to " + data.live.save), said = make("p", "");
  save.id = "save"; said.id = "saved";
  save.onclick = async () => {
    try { const done = await call("save", {}); said.textContent = done.count + " values are in " + done.file; }
    catch (refused) { said.textContent = refused.message; }
  };
  // folded by block; what a search finds is open
  const folds = [...new Set(tunables.map(row => row.block))].map(block => {
    const fold = make("details", "", "fold"), mine = tunables.filter(row => row.block === block);
    fold.append(make("summary", block + " (" + mine.length + ")"), ...mine.map(tunable));
    fold.open = tunables.length <= FEW_PARAMETERS;
    return fold;
  });
  seek.oninput = () => folds.forEach(fold => {
    const boxes = [...fold.querySelectorAll(".tunable")];
    boxes.forEach(box => { box.hidden = !box.dataset.path.includes(seek.value); });
    fold.hidden = boxes.every(box => box.hidden);
    fold.open = seek.value ? !fold.hidden : tunables.length <= FEW_PARAMETERS;
  });
  panel.append(seek, save, said, ...folds);
  if (!folds.length) panel.append(make("p", "This graph has no parameter that can be changed while it runs."));
}

// A pad for each block that takes a velocity from the page. It springs back, and beats as long as it is held.
const BEAT = 200, PAD = {ahead: 0.16, aside: 0.08, turn: 0.3};
function pad(path) {
  const box = make("div", "", "pad"), field = make("div", "", "field"), knob = make("div", "", "knob");
  const turn = input("range", 0), said = make("div", path, "soft");
  field.setAttribute("aria-label", path + ", ahead and aside"); field.tabIndex = 0;
  turn.setAttribute("aria-label", path + ", turn to the left"); turn.dir = "rtl";
  turn.min = -1; turn.max = 1; turn.step = "any";
  field.append(knob); box.append(said, field, turn);
  let beat = Date.now() % 1e9, x = 0, y = 0, held = false, timer = null, busy = false;
  async function send() {
    if (busy) return;
    busy = true; beat += 1;
    const values = {ahead: held ? y * PAD.ahead : 0, aside: held ? -x * PAD.aside : 0, turn: held ? turn.value * PAD.turn : 0, beat};
    try { await call("set", {settings: Object.entries(values).map(([name, value]) => path + "." + name + "=" + value)}); said.textContent = path; }
    catch (refused) { said.textContent = refused.message; }
    busy = false;
    if (!held && (values.ahead || values.aside || values.turn)) send();
  }
  function hold() { if (!held) { held = true; timer = setInterval(send, BEAT); } send(); }
  function release() {
    if (!held) return;
    held = false; clearInterval(timer); x = y = 0; turn.value = 0; place(); send();
  }
  const place = () => { knob.style.left = 50 + 42 * x + "%"; knob.style.top = 50 - 42 * y + "%"; };
  const clip = value => Math.max(-1, Math.min(1, value));
  function drag(event) {
    const area = field.getBoundingClientRect();
    x = clip(2 * (event.clientX - area.left) / area.width - 1);
    y = clip(1 - 2 * (event.clientY - area.top) / area.height);
    place(); hold();
  }
  field.onpointerdown = event => { field.setPointerCapture(event.pointerId); drag(event); };
  field.onpointermove = event => { if (event.buttons) drag(event); };
  const keys = {ArrowUp: [0, 1], ArrowDown: [0, -1], ArrowLeft: [-1, 0], ArrowRight: [1, 0]};
  field.onkeydown = event => {
    if (!keys[event.key]) return;
    event.preventDefault(); [x, y] = keys[event.key]; place(); hold();
  };
  turn.oninput = hold;
  field.onpointerup = field.onpointercancel = field.onkeyup = field.onblur = turn.onchange = release;
  place();
  return box;
}
if (data.live.tuning)
  document.body.append(...Object.keys(data.blocks).filter(path => data.blocks[path].use === "hopping.Pad").map(pad));
const numbers = document.getElementById("numbers");
numbers.onchange = () => drawing.classList.toggle("plain", !numbers.checked);
const tune = document.getElementById("tune");
if (tune) tune.onclick = async () => { await refresh(); tuneAll(); };
look();
if (data.live.opened === "parameters") tune.click();
