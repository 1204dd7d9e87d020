// Plots over time and frequency, by uPlot.

import { axes, begin, color, line, range } from "./canvas.js";

const HUES = ["first", "second", "third", "fourth"];

// Height of a plot without its legend, CSS pixels.
const HEIGHT = 200;

const axis = (label) => ({
  label, labelSize: 18, labelFont: "12px system-ui", font: "12px system-ui", size: 46, stroke: () => color("faint"),
  grid: { stroke: () => color("grid"), width: 1 }, ticks: { show: false },
});
const below = (label) => ({ ...axis(label), size: 30 });

// Of a logarithmic axis lines at powers of ten alone.
const isPower = (value) => Number.isInteger(Math.round(Math.log10(value) * 1e6) / 1e6);
const powers = (_, values) => values.map((value) => (isPower(value) ? value : null));
const logarithmic = (label) => ({
  ...axis(label), grid: { stroke: () => color("grid"), width: 1, filter: powers }, filter: powers,
  values: (_, values) => values.map((value) => (value === null ? "" : value.toExponential(0))),
});

// A plot that fills its place in the page.
function plot(place, options, data) {
  const size = () => ({ width: Math.max(80, place.clientWidth), height: HEIGHT });
  const made = new uPlot({
    ...size(), legend: { live: false, isolate: true }, cursor: { drag: { x: false, y: false }, points: { show: false } }, ...options,
  }, data, place);
  new ResizeObserver(() => made.setSize(size())).observe(place);
  return made;
}

// Bands from the least to the largest of some channels, over time.
export class BandPlot {
  constructor(place, unit, named) {
    this.channels = named.map(([channel]) => channel);
    const series = [{}];
    const bands = [];
    named.forEach(([, label], k) => {
      const stroke = () => color(HUES[k]);
      series.push({ label, stroke, width: 1 }, { stroke, width: 1, label: "" });
      bands.push({ series: [2 * k + 1, 2 * k + 2], fill: () => `color-mix(in srgb, ${color(HUES[k])} 35%, transparent)` });
    });
    this.plot = plot(place, {
      series, bands, scales: { x: { time: false }, y: { range: (_, low, high) => range([low, high], 0.06, [-1, 1]) } },
      axes: [below("time (s)"), axis(unit)],
    }, [[], ...this.channels.flatMap(() => [[], []])]);
    // The largest and the least of a band are one entry of the legend.
    place.querySelectorAll(".u-legend .u-series").forEach((entry, k) => { entry.hidden = k % 2 === 1; });
  }

  draw({ times, least, largest }) {
    this.plot.setData([times, ...this.channels.flatMap((channel) => [largest[channel], least[channel]])]);
  }
}

// Lines over anything; `log` takes the logarithm of the values.
export class LinePlot {
  constructor(place, xLabel, unit, labels, { log = false, secondUnit = null } = {}) {
    const series = labels.map((label, k) => ({
      label, stroke: () => color(HUES[k]), width: 1.3, scale: secondUnit && k >= labels.length / 2 ? "z" : "y",
    }));
    const scales = { x: { time: false }, y: log ? { distr: 3 } : { range: (_, __, high) => [0, Math.max(0.1, high * 1.1)] } };
    if (secondUnit) scales.z = { range: (_, __, high) => [0, Math.max(1, high * 1.1)] };
    const second = secondUnit ? [{ ...axis(secondUnit), size: 62, scale: "z", side: 1, grid: { show: false } }] : [];
    this.plot = plot(place, { series: [{}, ...series], scales, axes: [below(xLabel), (log ? logarithmic : axis)(unit), ...second] },
      [[], ...labels.map(() => [])]);
  }

  draw(x, lines) {
    this.plot.setData([x, ...lines]);
  }
}

// Acceleration of C over force, both along the axes on which they are largest: a line if in phase, an ellipse if not.
export class Lissajous {
  constructor(canvas) { Object.assign(this, { canvas, x: [-1, 1], y: [-1, 1] }); }

  draw(rows, rateHz, peakHz) {
    const drawing = begin(this.canvas);
    const count = Math.min(rows.length, Math.max(60, Math.ceil((4 * rateHz) / Math.max(peakHz || 10, 1))));
    const latest = rows.slice(-count);
    const largest = (channel) => latest.reduce((most, row) => Math.max(most, Math.abs(row[channel]) || 0), 0);
    const chosen = (channels) => channels.reduce((a, b) => (largest(b) > largest(a) ? b : a));
    const force = chosen(chosen([4, 5, 2, 3, 0, 1]) < 2 ? [0, 1] : [4, 5, 2, 3]);
    const acceleration = chosen([8, 9]);
    const name = ["torque 1 (N·m)", "torque 2 (N·m)", "force x (N)", "force y (N)", "head x (N)", "head y (N)"][force];
    this.x = settle(this.x, largest(force));
    this.y = settle(this.y, largest(acceleration));
    const { x, y } = axes(drawing, this.x, this.y, name, acceleration === 8 ? "C x (m/s²)" : "C y (m/s²)");
    drawing.context.strokeStyle = color("first");
    drawing.context.lineWidth = 1.2;
    line(drawing.context, latest.map((row) => [x(row[force]), y(row[acceleration])]));
  }
}

// A symmetric range that grows at once and shrinks slowly.
function settle([, high], largest) {
  const wanted = Math.max(1.15 * largest, 1e-6);
  const next = wanted > high ? wanted : Math.max(wanted, 0.97 * high);
  return [-next, next];
}

// Responses over the computed branch: stable motions as a line, unstable ones dashed, folds as circles.
export class ResponsePlot {
  constructor(canvas) { this.canvas = canvas; }

  draw(branch, points, joint, currentHz) {
    const drawing = begin(this.canvas);
    const { context, width, height } = drawing;
    const lines = branch ? [...branch.stable, ...branch.unstable].filter((point) => point !== null) : [];
    const read = points.map((point) => [point.frequency_hz, ...point.amplitude_rad]);
    const all = [...lines, ...read];
    if (all.length === 0) {
      context.fillStyle = color("faint");
      context.textAlign = "center";
      context.fillText("no response has been read", width / 2, height / 2);
      return;
    }
    const spread = range(all.map((point) => point[0]), 0.02, [0, 1]);
    const high = range(all.map((point) => point[1 + joint]), 0.05, [0, 1])[1];
    const { x, y } = axes(drawing, spread, [0, high], "frequency (Hz)", `largest |α${joint + 1}| (rad)`);
    const at = (point) => (point === null ? null : [x(point[0]), y(point[1 + joint])]);
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
    if (points.length > 0) circle(context, at(read[read.length - 1]), 8, false);
    if (currentHz > spread[0] && currentHz < spread[1]) {
      context.strokeStyle = color("edge");
      line(context, [[x(currentHz), y(0)], [x(currentHz), y(high)]]);
    }
  }
}

function circle(context, [x, y], radius, filled) {
  context.beginPath();
  context.arc(x, y, radius, 0, 2 * Math.PI);
  if (filled) context.fill(); else context.stroke();
}
