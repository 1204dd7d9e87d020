// The page: messages are stored in `data`, which is drawn with each update, up to thirty times a second.

import { Clipping } from "./clipped.js";
import { Controls } from "./controls.js";
import { BandPlot, LinePlot, Lissajous, ResponsePlot } from "./plots.js";
import { connect, decode } from "./stream.js";
import { StructureView } from "./structure.js";

const STRETCHES_KEPT = 800;
const ROWS_KEPT = 4096;
const TIMINGS_KEPT = 600;
const EVENTS_SHOWN = 200;

const element = (id) => document.getElementById(id);
let data = null;
let views = null;
let waiting = false;

// The data before the first update.
function empty(about) {
  const columns = () => about.channels.map(() => []);
  return {
    about, times: [], least: columns(), largest: columns(), clipped: [], rows: [], rowsClipped: [], newest: 0, head: null, spectrum: null, branch: null, player: null,
    points: [], timing: noTimings(), frames: 0,
    // Time spent drawing, ms.
    drawing_ms: 0,
  };
}

// The loop's timing: of each update, and the latest.
function noTimings() {
  return { times: [], columns: [[], [], [], []], latest: null };
}

function makeViews(about) {
  const { panels } = about;
  const torque = about.unit === "N·m";
  const named = (plotted) => plotted.map(({ channel, label }) => [channel, label]);
  const units = (plotted) => [...new Set(plotted.map(({ unit }) => unit))].join(", ");
  const loads = named(torque ? panels.torque : panels.force);
  const forces = named(panels.head);
  element("force-name").textContent = torque ? "Load" : "Load and force in the head";
  element("force").hidden = torque;
  const upper = { height: 145, isUpper: true };
  // Two plots: command and reading lie one over the other where the exciter is a good one.
  const force = torque ? {} : { "force": new BandPlot(about, element("force"), element("force-clipped"), "head (N)", forces, { height: 170 }) };
  const atC = named(panels.acceleration_c).map(([channel, label]) => [channel, `C ${label}`]);
  const states = {};
  for (const id of ["coordinates", "elements"]) {
    element(id).hidden = panels[id].length === 0;
    if (panels[id].length > 0) {
      const unit = id === "elements" ? `states (${units(panels[id])})` : units(panels[id]);
      states[id] = new BandPlot(about, element(id), null, unit, named(panels[id]));
    }
  }
  element("states").hidden = panels.coordinates.length === 0;
  element("states-name").textContent = panels.elements.length > 0 ? "Coordinates and elements" : "Coordinates";
  return {
    structure: new StructureView(about, element("structure"), element("structure-scale"), element("structure-clipped")),
    response: new ResponsePlot(element("response")),
    bands: {
      "load": new BandPlot(about, element("load"), null, `load (${about.unit})`, loads, torque ? {} : upper),
      ...force,
      "acceleration-b":
        new BandPlot(about, element("acceleration-b"), element("b-clipped"), "m/s²", named(panels.acceleration_b)),
      "acceleration-c":
        new BandPlot(about, element("acceleration-c"), element("c-clipped"), "m/s²", named(panels.acceleration_c)),
      ...states,
    },
    lissajous: new Lissajous(about, element("lissajous"), element("lissajous-clipped")),
    spectrumClipping: new Clipping(about, [...forces, ...atC]),
    spectrum: new LinePlot(element("spectrum"), "frequency (Hz)", "amplitude", [
      ...forces.map(([, label]) => `${label.replace("head", "force")} (N)`),
      ...atC.map(([, label]) => `${label} (m/s²)`),
    ], { log: true }),
    timing: new LinePlot(element("timing"), "time (s)", "load (%)", ["load", "largest", "lateness", "latest"],
      { secondUnit: "lateness (µs)" }),
  };
}

// The titles of panels, the choice of responses, and the modes.
function entitle(about) {
  const isArm = about.drawing?.subject === "arm";
  element("structure-name").textContent = isArm ? "Arm" : "Structure";
  element("structure-choices").hidden = about.drawing === null;
  const [, b, c] = isArm ? [] : about.rig ?? [];
  element("b-name").textContent = `Acceleration of B${b ? `, at ${b}` : ""}`;
  element("c-name").textContent = `Acceleration of C${c ? `, at ${c}` : ""}`;
  const modes = about.modes_hz.map((hz) => hz.toFixed(2));
  element("modes").textContent = modes.length > 0 ? `modes: ${modes.join(", ")} Hz` : "";
  element("responses").replaceChildren(...about.responses.map(({ label }, place) => {
    const [choice, button] = [document.createElement("label"), document.createElement("input")];
    Object.assign(button, { type: "radio", name: "response", value: place, checked: place === about.response });
    choice.append(button, ` ${label}`);
    return choice;
  }));
}

// Takes a text message of each kind.
const receive = {
  about(about) {
    const first = data === null;
    data = empty(about);
    element("events").replaceChildren();
    element("what").textContent =
      `${about.role} on ${about.place}: ${about.structure}, ${about.rate_hz} samples a second`;
    document.title = `Resonarm: ${about.role}`;
    if (first) views = makeViews(about);
    controls.show(about);
    entitle(about);
  },
  state({ state, fault }) {
    element("state").textContent = { operational: "armed", "pre-operational": "ready", fault: "fault" }[state] ?? state;
    element("state").className = state;
    element("fault").textContent = fault ?? "";
    controls.stateChanged();
  },
  event({ time_s, name, value, text }) {
    const entry = document.createElement("li");
    entry.textContent = `${time_s.toFixed(3)} s  ${text ?? (value === 0 ? name : `${name} ${value}`)}`;
    entry.className = name === "emergency" || name === "state.fault" ? "bad" : "";
    element("events").prepend(entry);
    while (element("events").children.length > EVENTS_SHOWN) element("events").lastChild.remove();
    if (name === "request.refused") controls.notTaken();
  },
  response(point) { data.points.push(point); },
  branch(branch) { data.branch = branch; },
  spectrum(spectrum) { data.spectrum = spectrum; },
  restarted() {
    Object.assign(data, { times: [], least: data.least.map(() => []), largest: data.least.map(() => []), clipped: [] });
    Object.assign(data, { rows: [], rowsClipped: [], points: [], spectrum: null, timing: noTimings() });
    element("events").replaceChildren();
    receive.state({ state: "unknown", fault: null });
  },
  player(player) {
    data.player = player;
    controls.player(player);
  },
  "set-point"(setPoint) { controls.setPoint(setPoint); },
  taken() {},
  refused({ why }) { controls.refused(why); },
  ended() {
    element("link").textContent = data.about.samples ? "the program has ended" : "the run is over";
    controls.end();
  },
};

function updated(buffer) {
  if (data === null) return;
  const { head, stretches, rows } = decode(buffer, data.about.channels.length);
  const { about, times, least, largest, clipped } = data;
  for (const stretch of stretches) {
    times.push(stretch.first / about.rate_hz);
    clipped.push(stretch.clipped);
    least.forEach((column, channel) => column.push(known(stretch.least[channel])));
    largest.forEach((column, channel) => column.push(known(stretch.largest[channel])));
  }
  [times, clipped, ...least, ...largest].forEach((column) => column.splice(0, column.length - STRETCHES_KEPT));
  if (head.first !== data.newest + 1) [data.rows, data.rowsClipped] = [[], []];
  data.rows.push(...rows);
  data.rowsClipped.push(...head.rows_clipped);
  [data.rows, data.rowsClipped].forEach((column) => column.splice(0, column.length - ROWS_KEPT));
  data.newest = head.sample;
  data.head = head;
  if (head.timing) takeTiming(head);
  if (!waiting) {
    waiting = true;
    requestAnimationFrame(draw);
  }
}

const known = (value) => (Number.isNaN(value) ? null : value);

function takeTiming({ time_s, timing }) {
  const { times, columns } = data.timing;
  data.timing.latest = timing;
  times.push(time_s);
  [100 * timing.load, 100 * timing.load_most, timing.late_us, timing.late_most_us].forEach((value, k) => columns[k].push(value));
  [times, ...columns].forEach((column) => column.splice(0, column.length - TIMINGS_KEPT));
}

// The canvases on the screen: others are not drawn.
const seen = new Set();
const watching = new IntersectionObserver((entries) => entries.forEach(({ target, isIntersecting }) => {
  if (isIntersecting) seen.add(target.id); else seen.delete(target.id);
}));
document.querySelectorAll("canvas[id], .plot").forEach((place) => watching.observe(place));

function draw() {
  waiting = false;
  if (data === null || data.head === null) return;
  const begun = performance.now();
  const { about, head, rows, rowsClipped, spectrum, branch, points } = data;
  const peakHz = spectrum?.peak_hz ?? 0;
  element("time").textContent = `${head.time_s.toFixed(2)} s`;
  controls.time(head.time_s);
  const place = Number(document.querySelector("[name=response]:checked").value);
  // A paused recording shows its current sample.
  const moves = data.player?.playing ?? true;
  const choices = { toScale: element("to-scale").checked, stroboscope: moves && element("stroboscope").checked };
  if (seen.has("structure")) views.structure.draw(rows, rowsClipped, data.newest, about, peakHz, choices);
  for (const [id, band] of Object.entries(views.bands)) if (seen.has(id)) band.draw(data);
  if (seen.has("lissajous")) views.lissajous.draw(rows, rowsClipped, about.rate_hz, peakHz);
  if (seen.has("spectrum") && spectrum !== drawn.spectrum) drawSpectrum(spectrum);
  if (seen.has("response")) views.response.draw(branch, points, place, about.responses[place], peakHz);
  drawTiming(head);
  data.frames += 1;
  data.drawing_ms += performance.now() - begun;
}

const drawn = { spectrum: null };

function drawSpectrum(spectrum) {
  drawn.spectrum = spectrum;
  const { head, acceleration_c } = data.about.panels;
  // Of two axes those that the structure has.
  const of = (both, plotted) => plotted.map(({ channel }) => (both ? both[channel % 2] : []));
  const lines = [...of(spectrum?.force, head), ...of(spectrum?.acceleration_c, acceleration_c)];
  const x = lines[0].map((_, k) => k * spectrum.line_hz);
  // A logarithm has no zero.
  views.spectrum.draw(x, lines.map((values) => values.map((value) => (value > 1e-6 ? value : null))));
  element("spectrum-clipped").textContent = spectrum ? views.spectrumClipping.words([spectrum.clipped]) : "";
  element("peak").textContent = spectrum?.peak_hz ? `largest at ${spectrum.peak_hz.toFixed(2)} Hz` : "";
}

const counted = (count, noun) => `${count} ${noun}${count === 1 ? "" : "s"}`;

function drawTiming({ timing, overruns, overrun_causes, lost, lost_updates, viewers }) {
  const { times, columns, latest } = data.timing;
  if (timing && seen.has("timing")) views.timing.draw(times, columns);
  const schedule = latest ? `load ${(100 * latest.load).toFixed(1)} %, ${latest.late_us.toFixed(0)} µs late` : "no schedule";
  element("timing-numbers").textContent =
    `${schedule}, ${counted(viewers, "viewer")}, ${counted(lost, "record")} and ${counted(lost_updates, "update")} lost`;
  const causes = overrun_causes.map(([cause, count]) => `${count} ${cause}`).join(", ");
  const missed = `${counted(overruns, "deadline")} missed${causes ? `: ${causes}` : ""}`;
  element("overruns").textContent = latest || overruns > 0 ? missed : "";
}

function linked(isLinked) {
  element("link").textContent = isLinked ? "connected" : "not connected";
  element("link").className = isLinked ? "numbers" : "numbers lost";
  controls.linked(isLinked);
}

const controls = new Controls((message) => stream.send(message));
const stream = connect({ received: ({ kind, ...message }) => receive[kind]?.(message), updated, linked });
// For programs that inspect the page.
window.resonarm = { ask: controls.ask, get data() { return data; }, get views() { return views; } };
