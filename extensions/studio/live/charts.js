"use strict";
// Strip charts: the last seconds of the fields that a user has chosen, sampled while the page looks.
const SPAN = 20, GAP = 1, HEIGHT = 96, CHART_PERIOD = 100, MOST_CHARTS = 8;
const COLOURS = ["#ef5350", "#43a047", "#42a5f5", "#ab47bc", "#fb8c00", "#00897b", "#8d6e63", "#78909c"];
const charts = new Map();
const strip = document.createElement("section");
strip.id = "charts"; strip.hidden = true; strip.setAttribute("aria-label", "strip charts");
document.querySelector("main").append(strip);

const svgTag = (tag, attributes, text) => {
  const made = document.createElementNS("http://www.w3.org/2000/svg", tag);
  for (const [name, value] of Object.entries(attributes)) made.setAttribute(name, value);
  if (text !== undefined) made.textContent = text;
  return made;
};
const short = value => String(+value.toPrecision(4));

async function chart(name) {
  if (charts.has(name)) { removeChart(name); return; }
  if (charts.size >= MOST_CHARTS) throw new Error("at most " + MOST_CHARTS + " charts at once; close one");
  const about = await call("lines?field=" + encodeURIComponent(name));
  const box = make("figure", "", "chart"), caption = document.createElement("figcaption");
  box.dataset.field = name;
  const more = about.size > about.names.length ? ", the first " + about.names.length + " of " + about.size : "";
  caption.append(make("b", name), about.unit ? " [" + about.unit + "]" : "", more);
  const close = make("button", "×");
  close.setAttribute("aria-label", "close the chart of " + name);
  close.onclick = () => removeChart(name);
  const legend = make("span", "", "legend");
  const keys = about.names.map((element, k) => {
    const key = make("span", ""), mark = make("i", "");
    mark.style.background = COLOURS[k % COLOURS.length];
    if (k >= COLOURS.length) mark.className = "dashed";
    const value = make("output", "");
    key.append(mark, about.names.length > 1 ? element + " " : "", value);
    legend.append(key);
    return value;
  });
  caption.append(" ", legend, close);
  const picture = svgTag("svg", {role: "img", "aria-label": "the last " + SPAN + " s of " + name, height: HEIGHT});
  box.append(caption, picture);
  strip.append(box); strip.hidden = false;
  charts.set(name, {about, picture, keys, samples: []});
}
function removeChart(name) {
  strip.querySelector('[data-field="' + CSS.escape(name) + '"]').remove();
  charts.delete(name);
  strip.hidden = !charts.size;
}
const nameOfValue = (about, value) => about.values[String(Math.round(value))] ?? short(value);

// Takes the numbers of one look; a run that has gone back takes its later samples with it.
function addSamples(time, found) {
  for (const [name, one] of charts) {
    const values = found[name];
    if (!values) continue;
    while (one.samples.length && one.samples[one.samples.length - 1].time >= time) one.samples.pop();
    one.samples.push({time, values});
    while (one.samples[0].time < time - SPAN) one.samples.shift();
    values.forEach((value, k) => {
      one.keys[k].textContent = value === null ? "not finite" : nameOfValue(one.about, value);
    });
    drawChart(one);
  }
}
function drawChart({about, picture, samples}) {
  const width = picture.clientWidth || 600, left = 64, right = width - 6, top = 6, bottom = HEIGHT - 16;
  const all = samples.flatMap(sample => sample.values).filter(value => value !== null);
  if (!all.length) { picture.replaceChildren(); return; }
  let low = Math.min(...all), high = Math.max(...all);
  if (high - low < 1e-12 * Math.max(1, Math.abs(high))) { const room = Math.abs(high) / 10 || 1; low -= room; high += room; }
  const end = samples[samples.length - 1].time, start = end - SPAN;
  const x = time => left + (right - left) * (time - start) / SPAN;
  const y = value => bottom - (bottom - top) * (value - low) / (high - low);
  const parts = [];
  const named = [...new Set(all)].filter(value => about.values[String(value)] !== undefined);
  const marks = Object.keys(about.values).length ? named : [low, high];
  if (marks.length === 2 && low < 0 && high > 0 && Math.min(y(low) - y(0), y(0) - y(high)) > 12) marks.push(0);
  for (const mark of marks) {
    parts.push(svgTag("line", {x1: left, x2: right, y1: y(mark), y2: y(mark), class: "grid"}));
    parts.push(svgTag("text", {x: left - 4, y: y(mark) + 4, "text-anchor": "end"}, nameOfValue(about, mark)));
  }
  for (let mark = Math.ceil(Math.max(start, 0) / 5) * 5; mark <= end; mark += 5)
    parts.push(svgTag("text", {x: x(mark), y: HEIGHT - 3, "text-anchor": "middle"}, mark + " s"));
  about.names.forEach((_, k) => {
    // what is not finite, or was not looked at for a while, breaks the line
    let path = "", pen = "M", before = -Infinity;
    for (const {time, values} of samples) {
      if (time - before > GAP) pen = "M";
      before = time;
      if (values[k] === null || values[k] === undefined) { pen = "M"; continue; }
      path += pen + x(time).toFixed(1) + " " + y(values[k]).toFixed(1);
      pen = "L";
    }
    const line = svgTag("path", {d: path, stroke: COLOURS[k % COLOURS.length]});
    if (k >= COLOURS.length) line.setAttribute("stroke-dasharray", "5 3");
    parts.push(line);
  });
  picture.replaceChildren(...parts);
}
// Every block that is shown offers the fields of its outputs.
shown.push(path => {
  const fields = Object.keys(now).filter(key => key.split(".").slice(0, -2).join(".") === path);
  if (!fields.length) return;
  const row = make("p", "", "charted"), refused = make("span", "", "error");
  for (const field of fields) {
    const button = make("button", field.slice(path.length + 1));
    const mark = () => button.setAttribute("aria-pressed", charts.has(field));
    button.onclick = async () => {
      try { await chart(field); refused.textContent = ""; } catch (error) { refused.textContent = error.message; }
      mark();
    };
    mark();
    row.append(button, " ");
  }
  panel.append(make("h2", "Strip charts"), row, refused);
});
