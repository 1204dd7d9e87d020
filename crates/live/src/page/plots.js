// Plots over time and frequency, by uPlot.

import { axes, begin, color, line, range, readable, words } from "./canvas.js";
import { Clipping } from "./clipped.js";
import { columns, firstAtOrAfter } from "./history.js";

const HUES = ["first", "second", "third", "fourth"];
// Curves of a plot that are shown at first; the names under it show the others.
const SHOWN = HUES.length;
// The colour of a curve: of the first from the page, of further ones around the circle.
const hue = (k) => (k < HUES.length ? color(HUES[k]) : `hsl(${(k * 67) % 360} 55% 50%)`);

// Height of a plot without its legend, CSS pixels.
const HEIGHT = 200;
// Opacity of lines and bands.
const LINE = "90%", BAND = "28%";
// Height of the bar over a stretch with a clipped reading, CSS pixels.
const BAR = 4;

const axis = (label) => ({
  label, labelSize: 18, labelFont: "12px system-ui", font: "12px system-ui", size: 46, space: 22, stroke: () => color("faint"),
  grid: { stroke: () => color("grid"), width: 1 }, ticks: { show: false },
});
const below = (label) => ({ ...axis(label), size: 30, space: 50 });
// Under a plot that shares its time axis with the one below.
const above = { ...axis(), label: undefined, size: 24, space: 50 };

// On a logarithmic axis only the powers of ten have lines.
const isPower = (value) => Number.isInteger(Math.round(Math.log10(value) * 1e6) / 1e6);
const powers = (_, values) => values.map((value) => (isPower(value) ? value : null));
const logarithmic = (label) => ({
  ...axis(label), grid: { stroke: () => color("grid"), width: 1, filter: powers }, filter: powers,
  values: (_, values) => values.map((value) => (value === null ? "" : value.toExponential(0))),
});

// The library counts the marks from the lowest value on, which need not be round.
const decades = (_, __, low, high) => {
  const marks = [];
  for (let power = Math.floor(Math.log10(low)); 10 ** power <= high; power += 1) {
    for (let digit = 1; digit < 10; digit += 1) marks.push(Number(`${digit}e${power}`));
  }
  return marks.filter((mark) => mark >= low && mark <= high);
};
// On the other logarithmic axis 1, 2 and 5 of each decade have names.
const named = (_, values) => values.map((value) => (/^[125](e|$)/.test(value?.toExponential()) ? value : null));

// Large numbers fit beside a second axis: 1.5M.
const compact = new Intl.NumberFormat("en", { notation: "compact" });
// Small numbers have an exponent: 2e-6.
const plain = new Intl.NumberFormat("en");
const small = (value) => (value === 0 ? "0" : Number(value.toPrecision(3)).toExponential());
const ordinary = (_, shown) => {
  const isSmall = Math.max(...shown.map(Math.abs)) < 0.01;
  return shown.map((value) => (isSmall ? small(value) : plain.format(value)));
};

// A value at the cursor.
const digits = (value) => (value === 0 ? "0" : plain.format(Number(value.toPrecision(4))));
const shownValue = (value) => (Math.abs(value) < 0.01 ? small(value) : digits(value));
const between = (low, high) => {
  if (low === null || high === null || low === undefined || high === undefined) return "";
  return low === high ? shownValue(high) : `${shownValue(low)} … ${shownValue(high)}`;
};

// A plot that fills its place in the page, with a legend that has the values at the cursor. A viewer drags across it to
// zoom, drags with Shift to move, and clicks twice to return.
function plot(place, height, { about, entries, values, zoomed, moved, returned, unit = "", ...options }, data) {
  const size = () => ({ width: Math.max(80, place.clientWidth), height });
  const cursor = {
    drag: { x: true, y: false, setScale: false }, points: { show: false }, ...options.cursor,
    bind: {
      dblclick: () => () => { returned(); return null; },
      mousedown: (drawn, _, begin) => (event) => { if (event.shiftKey) drags(drawn, event, moved); else begin(event); return null; },
    },
  };
  const select = (drawn) => {
    const { left, width } = drawn.select;
    // A click with an unsteady hand is a drag of a few pixels.
    if (width < 5) return;
    const [from, to] = [drawn.posToVal(left, "x"), drawn.posToVal(left + width, "x")];
    drawn.setSelect({ left: 0, width: 0, top: 0, height: 0 }, false);
    zoomed(from, to);
  };
  let list = null;
  const read = (drawn) => list?.read(drawn.cursor.idx, drawn);
  const hooks = { ...options.hooks, setSelect: [select], setCursor: [read] };
  const made = new uPlot({ ...size(), legend: { show: false }, ...options, cursor, hooks }, data, place);
  list = legend(made, entries, values, unit);
  new ResizeObserver(() => made.setSize(size())).observe(place);
  place.append(list.element);
  const canvas = place.querySelector("canvas");
  canvas.setAttribute("role", "img");
  canvas.setAttribute("aria-label", `${about}: ${entries.map(({ name }) => name).join(", ")}`);
  return made;
}

// Moves the plot with the mouse until its button is let go; `moved` takes how far, as a part of the plot's width.
function drags(drawn, { clientX }, moved) {
  let from = clientX;
  const drag = (event) => {
    moved((from - event.clientX) / drawn.over.clientWidth);
    from = event.clientX;
  };
  const end = () => {
    removeEventListener("mousemove", drag);
    removeEventListener("mouseup", end);
  };
  addEventListener("mousemove", drag);
  addEventListener("mouseup", end);
}

// A button for each entry, { label, name, series }, that shows or hides its series, and beside it the value at the cursor.
// Screen readers get the channel's name, too.
function legend(made, entries, values, unit) {
  const element = document.createElement("p");
  element.className = "legend";
  const outputs = entries.map(({ label, name, series }, k) => {
    const [entry, button] = [document.createElement("span"), document.createElement("button")];
    const [mark, value] = [document.createElement("i"), document.createElement("span")];
    mark.style.color = k < HUES.length ? `var(--${HUES[k]})` : hue(k);
    value.className = "value";
    button.type = "button";
    button.append(mark, label);
    if (name !== label) button.setAttribute("aria-label", `${label}: ${name}`);
    button.setAttribute("aria-pressed", k < SHOWN);
    button.addEventListener("click", () => {
      const show = button.getAttribute("aria-pressed") !== "true";
      button.setAttribute("aria-pressed", show);
      made.batch(() => series.forEach((one) => made.setSeries(one, { show })));
    });
    entry.append(button, value);
    element.append(entry);
    return value;
  });
  const where = document.createElement("span");
  where.className = "value";
  element.append(where);
  const read = (place, drawn) => {
    const x = place === null || place === undefined ? undefined : drawn.data[0][place];
    where.textContent = x === undefined ? "" : `at ${x.toPrecision(6)} ${unit}`;
    outputs.forEach((output, k) => { output.textContent = x === undefined ? "" : values(drawn, entries[k].series, place); });
  };
  return { element, read };
}

// Bands from the least to the largest of some channels, over time. A bar along the top marks the stretches in which a
// reading was clipped, and the note says which.
export class BandPlot {
  constructor(about, place, note, { title, unit, named, steering, height = HEIGHT, isUpper = false }) {
    Object.assign(this, { place, note, clipping: new Clipping(about, named), marked: [], drawn: null, x: [0, 1] });
    this.channels = named.map(([channel]) => channel);
    const series = [{}];
    const bands = [];
    named.forEach(([, label], k) => {
      const thin = (opacity) => () => `color-mix(in srgb, ${hue(k)} ${opacity}, transparent)`;
      const one = { label, stroke: thin(LINE), width: 1.2, show: k < SHOWN, points: { show: false } };
      // The largest values first: uPlot fills a band from its first series down to the second.
      series.push({ ...one }, { ...one });
      bands.push({ series: [2 * k + 1, 2 * k + 2], fill: thin(BAND) });
    });
    const entries = named.map(([channel, label], k) => ({ label, name: about.channels[channel], series: [2 * k + 1, 2 * k + 2] }));
    const values = (drawn, [high, low], at) => between(drawn.data[low][at], drawn.data[high][at]);
    this.plot = plot(place, height, {
      about: title, entries, values, unit: "s", ...steering, series, bands,
      scales: { x: { time: false, range: () => this.x }, y: { range: (_, low, high) => range([low, high], 0.06, [-1, 1]) } },
      cursor: { sync: { key: "time" } },
      axes: [isUpper ? above : below("time (s)"), { ...axis(unit), values: ordinary }], hooks: { draw: [(drawn) => this.mark(drawn)] },
    }, [[], ...this.channels.flatMap(() => [[], []])]);
  }

  draw(data, ends) {
    const { about, times, clipped, head } = data;
    const width_s = head.width / about.rate_hz;
    const [begin, end] = [firstAtOrAfter(times, ends[0] - width_s), firstAtOrAfter(times, ends[1])];
    const bits = clipped.slice(begin, end);
    this.marked = [];
    bits.forEach((one, k) => {
      if (!this.clipping.has(one)) return;
      const [from_s, latest] = [times[begin + k], this.marked[this.marked.length - 1]];
      // Stretches that touch become one bar, also if their times differ by a rounding.
      if (latest && from_s - latest[1] < 0.5 * width_s) latest[1] = from_s + width_s; else this.marked.push([from_s, from_s + width_s]);
    });
    if (this.note) this.note.textContent = this.clipping.words(bits);
    this.x = ends;
    this.drawn = columns(data, this.channels, ends, this.plot.over.clientWidth);
    const { times: x, least, largest } = this.drawn;
    this.plot.setData([x, ...this.channels.flatMap((_, c) => [largest[c], least[c]])]);
  }

  mark(drawn) {
    const { ctx, bbox } = drawn;
    const at = (time_s) => Math.min(bbox.left + bbox.width, Math.max(bbox.left, Math.round(drawn.valToPos(time_s, "x", true))));
    ctx.fillStyle = color("bad");
    for (const [from_s, to_s] of this.marked) {
      ctx.fillRect(at(from_s), bbox.top, Math.max(1, at(to_s) - at(from_s)), BAR * devicePixelRatio);
    }
  }
}

// Lines over any axis; `log` makes the vertical axis logarithmic, and `logX` the other one; with `spans` lines go on
// where values are missing. With `steering` the axis is the shared time, else a
// viewer zooms into this plot alone.
export class LinePlot {
  constructor(place, { title, x, unit, entries, steering = null, log = false, logX = false, spans = false, secondUnit = null }) {
    this.zoomed = null;
    this.x = [0, 1];
    const series = entries.map(({ label }, k) => ({
      label, stroke: () => color(HUES[k]), width: 1.3, scale: secondUnit && k >= entries.length / 2 ? "z" : "y", points: { show: false }, spanGaps: spans,
    }));
    const whole = (low, high) => (high > low ? [low, high] : logX ? [1, 10] : [0, 1]);
    const along = (_, low, high) => (steering ? this.x : this.zoomed ?? whole(low, high));
    const scales = {
      x: { time: false, range: along, distr: logX ? 3 : 1 }, y: log ? { distr: 3 } : { range: (_, __, high) => [0, Math.max(0.1, high * 1.1)] },
    };
    if (secondUnit) scales.z = { range: (_, __, high) => [0, Math.max(1, high * 1.1)] };
    const values = (_, shown) => shown.map((value) => compact.format(value));
    const second = secondUnit ? [{ ...axis(secondUnit), scale: "z", side: 1, grid: { show: false }, values }] : [];
    const first = log ? logarithmic(unit) : { ...axis(unit), values };
    const own = {
      zoomed: (from, to) => this.zoom([from, to]), returned: () => this.zoom(null),
      moved: (part) => {
        if (this.zoomed === null) return;
        const by = part * (this.zoomed[1] - this.zoomed[0]);
        this.zoom(this.zoomed.map((end) => end + by));
      },
    };
    this.plot = plot(place, HEIGHT, {
      about: title, entries: entries.map((entry, k) => ({ name: entry.label, ...entry, series: [k + 1] })), ...(steering ?? own),
      values: (drawn, [one], at) => between(drawn.data[one][at], drawn.data[one][at]), unit: x.unit,
      cursor: steering ? { sync: { key: "time" } } : {},
      series: [{}, ...series], scales, axes: [{ ...below(`${x.label} (${x.unit})`), ...(logX ? { splits: decades, filter: named } : {}) }, first, ...second],
    }, [[], ...entries.map(() => [])]);
  }

  zoom(to) {
    this.zoomed = to;
    this.plot.setData(this.plot.data);
  }

  draw(x, lines, ends = this.x) {
    this.x = ends;
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
  // Three per cent for each of thirty pictures a second: it halves in three quarters of a second.
  const next = wanted > high ? wanted : Math.max(wanted, 0.97 * high);
  return [-next, next];
}

// Responses over the computed branch: stable responses as a line, unstable ones dashed, folds as circles. A cross marks
// responses computed from clipped readings.
export class ResponsePlot {
  constructor(canvas, reading) {
    Object.assign(this, { canvas, reading, places: [] });
    canvas.addEventListener("pointermove", (event) => this.read(event));
    canvas.addEventListener("pointerleave", () => { reading.textContent = ""; });
  }

  // The response nearest to the pointer, in words.
  read({ offsetX, offsetY }) {
    const distance = ([x, y]) => Math.hypot(x - offsetX, y - offsetY);
    const nearest = this.places.reduce((a, b) => (a && distance(a.at) <= distance(b.at) ? a : b), null);
    this.reading.textContent = nearest && distance(nearest.at) < 30 ? nearest.words : "";
  }

  draw(branch, points, place, { title, unit }, currentHz) {
    const drawing = begin(this.canvas);
    const { context, width, height } = drawing;
    const lines = branch ? [...branch.stable, ...branch.unstable].filter((point) => point !== null) : [];
    const read = points.map((point) => [point.frequency_hz, ...point.amplitude]);
    const all = [...lines, ...read];
    this.places = [];
    if (all.length === 0) {
      words(context, "no response has been measured yet", width, height);
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
    this.places = points.map((point, k) => ({
      at: at(read[k]),
      words: `${point.frequency_hz.toFixed(5)} Hz, ${(scaled.factor * read[k][1 + place]).toPrecision(4)} ${scaled.unit}`
        + `${point.lag_deg === null ? "" : `, lag ${point.lag_deg.toFixed(1)}°`}${point.settled ? "" : ", not settled"}`,
    }));
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
