// Plots over time and frequency, by uPlot.

import { axes, begin, color, line, range, readable, words } from "./canvas.js";
import { Clipping } from "./clipped.js";

const HUES = ["first", "second", "third", "fourth"];
// Curves of a plot that are shown at first; the names under it show the others.
const SHOWN = HUES.length;
// The colour of a curve: of the first from the page, of further ones around the circle.
const hue = (k) => (k < HUES.length ? color(HUES[k]) : `hsl(${(k * 67) % 360} 55% 50%)`);

// Height of a plot without its legend, CSS pixels.
const HEIGHT = 200;
// Opacity of lines and bands.
const LINE = "65%", BAND = "35%";
// Height of the bar over a stretch with a clipped reading, CSS pixels.
const BAR = 4;

const axis = (label) => ({
  label, labelSize: 18, labelFont: "12px system-ui", font: "12px system-ui", size: 46, stroke: () => color("faint"),
  grid: { stroke: () => color("grid"), width: 1 }, ticks: { show: false },
});
const below = (label) => ({ ...axis(label), size: 30 });
// Under a plot that shares its time axis with the one below.
const above = { ...axis(), label: undefined, size: 24 };

// On a logarithmic axis only the powers of ten have lines.
const isPower = (value) => Number.isInteger(Math.round(Math.log10(value) * 1e6) / 1e6);
const powers = (_, values) => values.map((value) => (isPower(value) ? value : null));
const logarithmic = (label) => ({
  ...axis(label), grid: { stroke: () => color("grid"), width: 1, filter: powers }, filter: powers,
  values: (_, values) => values.map((value) => (value === null ? "" : value.toExponential(0))),
});

// Large numbers fit beside a second axis: 1.5M.
const compact = new Intl.NumberFormat("en", { notation: "compact" });
// Small numbers have an exponent: 2e-6.
const plain = new Intl.NumberFormat("en");
const small = (value) => (value === 0 ? "0" : Number(value.toPrecision(3)).toExponential());
const ordinary = (_, shown) => {
  const isSmall = Math.max(...shown.map(Math.abs)) < 0.01;
  return shown.map((value) => (isSmall ? small(value) : plain.format(value)));
};

// A plot that fills its place in the page, with a legend.
function plot(place, height, options, data, entries) {
  const size = () => ({ width: Math.max(80, place.clientWidth), height });
  const made = new uPlot({
    ...size(), legend: { show: false }, cursor: { drag: { x: false, y: false }, points: { show: false } }, ...options,
  }, data, place);
  new ResizeObserver(() => made.setSize(size())).observe(place);
  place.append(legend(made, entries));
  return made;
}

// A button for each entry, [label, series…], that shows or hides its series.
function legend(made, entries) {
  const list = document.createElement("p");
  list.className = "legend";
  entries.forEach(([label, ...series], k) => {
    const [button, mark] = [document.createElement("button"), document.createElement("i")];
    mark.style.color = k < HUES.length ? `var(--${HUES[k]})` : hue(k);
    button.type = "button";
    button.append(mark, label);
    button.setAttribute("aria-pressed", k < SHOWN);
    button.addEventListener("click", () => {
      const show = button.getAttribute("aria-pressed") !== "true";
      button.setAttribute("aria-pressed", show);
      made.batch(() => series.forEach((one) => made.setSeries(one, { show })));
    });
    list.append(button);
  });
  return list;
}

// Bands from the least to the largest of some channels, over time. A bar along the top marks the stretches in which a
// reading was clipped, and the note says which.
export class BandPlot {
  constructor(about, place, note, unit, named, { height = HEIGHT, isUpper = false } = {}) {
    Object.assign(this, { note, clipping: new Clipping(about, named), marked: [] });
    this.channels = named.map(([channel]) => channel);
    const series = [{}];
    const bands = [];
    named.forEach(([, label], k) => {
      const thin = (opacity) => () => `color-mix(in srgb, ${hue(k)} ${opacity}, transparent)`;
      const one = { label, stroke: thin(LINE), width: 1, show: k < SHOWN };
      series.push({ ...one }, { ...one });
      bands.push({ series: [2 * k + 1, 2 * k + 2], fill: thin(BAND) });
    });
    this.plot = plot(place, height, {
      series, bands, scales: { x: { time: false }, y: { range: (_, low, high) => range([low, high], 0.06, [-1, 1]) } },
      axes: [isUpper ? above : below("time (s)"), { ...axis(unit), values: ordinary }], hooks: { draw: [(drawn) => this.mark(drawn)] },
    }, [[], ...this.channels.flatMap(() => [[], []])], named.map(([, label], k) => [label, 2 * k + 1, 2 * k + 2]));
  }

  draw({ about, times, least, largest, clipped, head }) {
    const width_s = head.width / about.rate_hz;
    this.marked = times.filter((_, k) => this.clipping.has(clipped[k])).map((time_s) => [time_s, time_s + width_s]);
    if (this.note) this.note.textContent = this.clipping.words(clipped);
    this.plot.setData([times, ...this.channels.flatMap((channel) => [largest[channel], least[channel]])]);
  }

  mark(drawn) {
    const { ctx, bbox } = drawn;
    const at = (time_s) => Math.round(drawn.valToPos(time_s, "x", true));
    ctx.fillStyle = color("bad");
    for (const [from_s, to_s] of this.marked) {
      ctx.fillRect(at(from_s), bbox.top, Math.max(1, at(to_s) - at(from_s)), BAR * devicePixelRatio);
    }
  }
}

// Lines over any axis; `log` makes the vertical axis logarithmic.
export class LinePlot {
  constructor(place, xLabel, unit, labels, { log = false, secondUnit = null } = {}) {
    const series = labels.map((label, k) => ({
      label, stroke: () => color(HUES[k]), width: 1.3, scale: secondUnit && k >= labels.length / 2 ? "z" : "y",
    }));
    const scales = { x: { time: false }, y: log ? { distr: 3 } : { range: (_, __, high) => [0, Math.max(0.1, high * 1.1)] } };
    if (secondUnit) scales.z = { range: (_, __, high) => [0, Math.max(1, high * 1.1)] };
    const values = (_, shown) => shown.map((value) => compact.format(value));
    const second = secondUnit ? [{ ...axis(secondUnit), scale: "z", side: 1, grid: { show: false }, values }] : [];
    const first = log ? logarithmic(unit) : { ...axis(unit), values };
    this.plot = plot(place, HEIGHT, { series: [{}, ...series], scales, axes: [below(xLabel), first, ...second] },
      [[], ...labels.map(() => [])], labels.map((label, k) => [label, k + 1]));
  }

  draw(x, lines) {
    this.plot.setData([x, ...lines]);
  }
}

// Acceleration of C over force, each along the axis on which it is largest: a line if in phase, an ellipse if not. Dots
// mark clipped readings, and the note names them.
export class Lissajous {
  constructor(about, canvas, note) {
    const { torque, force, head, acceleration_c } = about.panels;
    const accelerations = acceleration_c.map(({ label, ...one }) => ({ ...one, label: `C ${label}` }));
    const forces = [...head, ...force];
    Object.assign(this, { about, canvas, note, torques: torque, forces, accelerations, x: [-1, 1], y: [-1, 1] });
  }

  draw(rows, clipped, rateHz, peakHz) {
    const drawing = begin(this.canvas);
    const count = Math.min(rows.length, Math.max(60, Math.ceil((4 * rateHz) / Math.max(peakHz || 10, 1))));
    const latest = rows.slice(-count);
    const largest = (channel) => latest.reduce((most, row) => Math.max(most, Math.abs(row[channel]) || 0), 0);
    const chosen = (all) => all.reduce((a, b) => (largest(b.channel) > largest(a.channel) ? b : a));
    const force = chosen([...this.forces, ...this.torques]);
    const acceleration = chosen(this.accelerations);
    this.x = settle(this.x, largest(force.channel));
    this.y = settle(this.y, largest(acceleration.channel));
    const title = ({ label, unit }) => `${label} (${unit})`;
    const { x, y } = axes(drawing, this.x, this.y, title(force), title(acceleration));
    drawing.context.strokeStyle = color("first");
    drawing.context.lineWidth = 1.2;
    const points = latest.map((row) => [x(row[force.channel]), y(row[acceleration.channel])]);
    line(drawing.context, points);
    const clipping = new Clipping(this.about, [force, acceleration].map(({ channel, label }) => [channel, label]));
    const bits = clipped.slice(-count);
    drawing.context.fillStyle = color("bad");
    points.forEach((point, k) => { if (clipping.has(bits[k])) circle(drawing.context, point, 2, true); });
    this.note.textContent = clipping.words(bits);
  }
}

// A symmetric range that grows at once and shrinks slowly.
function settle([, high], largest) {
  const wanted = Math.max(1.15 * largest, 1e-6);
  const next = wanted > high ? wanted : Math.max(wanted, 0.97 * high);
  return [-next, next];
}

// Responses over the computed branch: stable motions as a line, unstable ones dashed, folds as circles. A cross marks
// responses computed from clipped readings.
export class ResponsePlot {
  constructor(canvas) { this.canvas = canvas; }

  draw(branch, points, place, { title, unit }, currentHz) {
    const drawing = begin(this.canvas);
    const { context, width, height } = drawing;
    const lines = branch ? [...branch.stable, ...branch.unstable].filter((point) => point !== null) : [];
    const read = points.map((point) => [point.frequency_hz, ...point.amplitude]);
    const all = [...lines, ...read];
    if (all.length === 0) {
      words(context, "no response has been read", width, height);
      return;
    }
    const spread = range(all.map((point) => point[0]), 0.02, [0, 1]);
    const high = range(all.map((point) => point[1 + place]), 0.05, [0, 1])[1];
    const scaled = readable(unit, high);
    const { x, y } = axes(drawing, spread, [0, scaled.factor * high], "frequency (Hz)", `${title} (${scaled.unit})`);
    const at = (point) => (point === null ? null : [x(point[0]), y(scaled.factor * point[1 + place])]);
    context.lineWidth = 1.8;
    context.strokeStyle = color("first");
    if (branch) line(context, branch.stable.map(at));
    context.strokeStyle = color("second");
    context.setLineDash([6, 4]);
    if (branch) line(context, branch.unstable.map(at));
    context.setLineDash([]);
    context.strokeStyle = color("text");
    for (const fold of branch?.folds ?? []) circle(context, at(fold), 4, false);
    context.strokeStyle = context.fillStyle = color("third");
    points.forEach((point, k) => circle(context, at(read[k]), 4.5, point.settled));
    context.strokeStyle = color("bad");
    points.forEach((point, k) => { if (point.clipped[place]) cross(context, at(read[k]), 6); });
    context.strokeStyle = color("third");
    if (points.length > 0) circle(context, at(read[read.length - 1]), 8, false);
    if (currentHz > spread[0] && currentHz < spread[1]) {
      context.strokeStyle = color("faint");
      context.lineWidth = 1;
      line(context, [[x(currentHz), y(0)], [x(currentHz), y(scaled.factor * high)]]);
    }
  }
}

function circle(context, [x, y], radius, filled) {
  context.beginPath();
  context.arc(x, y, radius, 0, 2 * Math.PI);
  if (filled) context.fill(); else context.stroke();
}

function cross(context, [x, y], radius) {
  line(context, [[x - radius, y - radius], [x + radius, y + radius], null, [x - radius, y + radius], [x + radius, y - radius]]);
}
