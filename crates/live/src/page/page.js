// The page: messages are stored in `data`, which is drawn with each update, up to thirty times a second.

import { Clipping } from "./clipped.js";
import { Controls } from "./controls.js";
import { eventInWords, isBad } from "./events.js";
import { TimeWindow, columns, known } from "./history.js";
import { BandPlot, LinePlot, Lissajous, ResponsePlot } from "./plots.js";
import { csv, saveCsv, savePicture } from "./save.js";
import { connect, decode } from "./stream.js";
import { StructureView } from "./structure.js";

// Two minutes of stretches and of the loop's timing, and the latest samples.
const STRETCHES_KEPT = 12000;
const TIMINGS_KEPT = 3600;
const ROWS_KEPT = 16384;
const EVENTS_SHOWN = 200;
// Without a message for this long the values shown are taken to be out of date, ms. The program sends thirty a second.
const SILENT_MS = 3000;
// Viewers who prefer less motion see two pictures a second.
const REDUCED_MS = 500;
const STATES = { operational: "armed", "pre-operational": "ready", fault: "fault" };

const element = (id) => document.getElementById(id);
let data = null;
let views = null;
let waiting = false;
// While the display is paused: the data that are shown.
let paused = null;
const timeWindow = new TimeWindow();
const reducedMotion = matchMedia("(prefers-reduced-motion: reduce)");

// The data before the first update.
function empty(about) {
  const columns = () => about.channels.map(() => []);
  return {
    about, times: [], least: columns(), largest: columns(), clipped: [], rows: [], rowsClipped: [], newest: 0, head: null, spectrum: null, test: null, branch: null, player: null,
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
  // Two plots: command and reading lie one over the other where the exciter is a good one.
  const bands = (id, note, options) => new BandPlot(about, element(id), note && element(note), { steering, ...options });
  const force = torque ? {} : {
    "force": bands("force", "force-clipped", { title: "Force in the head", unit: "head (N)", named: forces, height: 170 }),
  };
  const acceleration = (id, letter) => {
    const plotted = named(panels[id.replace("-", "_")]);
    return bands(id, `${letter.toLowerCase()}-clipped`, { title: `Acceleration of ${letter}`, unit: "m/s²", named: plotted });
  };
  const atC = panels.acceleration_c.map(({ channel, label }) => [channel, `C ${label}`]);
  const states = {};
  for (const id of ["coordinates", "elements"]) {
    element(id).hidden = panels[id].length === 0;
    if (panels[id].length > 0) {
      const unit = id === "elements" ? `states (${units(panels[id])})` : units(panels[id]);
      states[id] = bands(id, null, { title: id === "elements" ? "States of elements" : "Coordinates", unit, named: named(panels[id]) });
    }
  }
  // The sensors beside B and C, those of one unit in one plot.
  const note = new Set(panels.sensors.map(({ unit }) => unit)).size === 1 ? "sensors-clipped" : null;
  ["m/s²", "m/s", "m", "rad"].forEach((unit) => {
    const id = `sensors-${unit.replace("/", "-").replace("²", "2")}`;
    const plotted = panels.sensors.filter((one) => one.unit === unit);
    element(id).hidden = plotted.length === 0;
    if (plotted.length > 0) states[id] = bands(id, note, { title: "Sensors", unit, named: named(plotted) });
  });
  element("sensors").hidden = panels.sensors.length === 0;
  element("states").hidden = panels.coordinates.length === 0;
  element("states-name").textContent = panels.elements.length > 0 ? "Coordinates and elements" : "Coordinates";
  const upper = torque ? {} : { height: 145, isUpper: true };
  const spectrum = (unit) => ([channel, label]) => ({ label: `${label.replace("head", "force")} (${unit})`, name: about.channels[channel] });
  return {
    structure: new StructureView(about, element("structure"), element("structure-scale"), element("structure-clipped")),
    response: new ResponsePlot(element("response"), element("response-reading")),
    bands: {
      "load": bands("load", null, { title: "Load", unit: `load (${about.unit})`, named: loads, ...upper }),
      ...force,
      "acceleration-b": acceleration("acceleration-b", "B"),
      "acceleration-c": acceleration("acceleration-c", "C"),
      ...states,
    },
    lissajous: new Lissajous(about, element("lissajous"), element("lissajous-clipped")),
    test: about.test && new LinePlot(element("test"), {
      title: `What the test has reached, and what is specified`, x: { label: "frequency", unit: "Hz" },
      unit: `${about.test.quantity} (${about.test.unit})`, log: about.test.kind !== "sine", logX: true, spans: true, entries: testEntries(about.test),
    }),
    spectrumClipping: new Clipping(about, [...forces, ...atC]),
    spectrum: new LinePlot(element("spectrum"), {
      title: "Spectrum", x: { label: "frequency", unit: "Hz" }, unit: "amplitude", log: true,
      entries: [...forces.map(spectrum("N")), ...atC.map(spectrum("m/s²"))],
    }),
    timing: new LinePlot(element("timing"), {
      title: "Load and lateness of the loop", x: { label: "time", unit: "s" }, unit: "load (%)", secondUnit: "lateness (µs)", steering,
      entries: [["load", "mean load, per cent"], ["largest", "largest load, per cent"], ["lateness", "mean lateness, microseconds"],
        ["latest", "largest lateness, microseconds"]].map(([label, name]) => ({ label, name })),
    }),
  };
}

// The curves of a test: what was read, and what is specified with its tolerance, if that is stated by frequency.
function testEntries({ channel, low }) {
  const entries = [{ label: channel, name: `read at ${channel}` }, { label: "specified", name: "specified at this level" }];
  const ends = [{ label: "lowest", name: "lower end of the tolerance" }, { label: "highest", name: "upper end of the tolerance" }];
  return low.length > 0 ? [...entries, ...ends] : entries;
}

// The titles of panels, the choice of responses, and the modes.
function entitle(about) {
  element("structure-choices").hidden = about.drawing === null;
  const [, b, c] = about.rig ?? [];
  element("test-panel").hidden = about.test === null;
  element("test-name").textContent = about.test ? about.test.name ?? about.test.kind : "";
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
    const drawnBy = ({ channels, panels, drawing, rate_hz, unit }) => JSON.stringify([channels, panels, drawing, rate_hz, unit]);
    // Another program at this address: its panels differ.
    if (!first && drawnBy(data.about) !== drawnBy(about)) return location.reload();
    data = empty(about);
    state = { state: "unknown", fault: null };
    element("events").replaceChildren();
    element("what").textContent =
      `${about.role} on ${about.place}: ${about.structure}, ${about.rate_hz} samples a second`;
    document.title = `Resonarm: ${about.role}`;
    if (first) views = makeViews(about);
    controls.show(about);
    entitle(about);
  },
  state(now) {
    state = now;
    showState();
    controls.stateChanged();
  },
  event({ time_s, name, value, text }) {
    const entry = document.createElement("li");
    entry.textContent = `${time_s.toFixed(3)} s  ${eventInWords({ name, value, text }, data.about.unit)}`;
    entry.dataset.name = name;
    entry.className = isBad(name) ? "bad" : "";
    element("events").prepend(entry);
    while (element("events").children.length > EVENTS_SHOWN) element("events").lastChild.remove();
    if (name === "request.refused") controls.notTaken();
  },
  response(point) { data.points.push(point); },
  branch(branch) { data.branch = branch; },
  spectrum(spectrum) { data.spectrum = spectrum; },
  test(test) {
    data.test = test;
    schedule();
  },
  restarted() {
    Object.assign(data, { times: [], least: data.least.map(() => []), largest: data.least.map(() => []), clipped: [] });
    Object.assign(data, { rows: [], rowsClipped: [], points: [], spectrum: null, test: null, timing: noTimings() });
    element("events").replaceChildren();
    resume();
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
    isOver = true;
    element("link").textContent = data.about.samples ? "the program has ended" : "the run is over";
    controls.end();
    showState();
  },
};

// The state of the watched node, whether it is the present one, and whether the run is over.
let state = { state: "unknown", fault: null };
let isCurrent = false;
let isOver = false;

// A state that may have changed since is named as a past one, and has no colour.
function showState() {
  const named = STATES[state.state] ?? state.state;
  const isPresent = isCurrent && !isOver;
  element("state").textContent = isPresent || state.state === "unknown" ? named : `was ${named}`;
  element("state").className = isPresent ? state.state : "past";
  element("fault").textContent = state.fault ?? "";
}

function updated(buffer) {
  if (data === null) return;
  const { head, stretches, rows } = decode(buffer, data.about.channels.length);
  const { about, times, least, largest, clipped } = data;
  for (const stretch of stretches) {
    times.push(stretch.first / about.rate_hz);
    clipped.push(stretch.clipped);
    least.forEach((column, channel) => column.push(orNull(stretch.least[channel])));
    largest.forEach((column, channel) => column.push(orNull(stretch.largest[channel])));
  }
  // A negative count removes nothing, so shorter columns stay as they are.
  [times, clipped, ...least, ...largest].forEach((column) => column.splice(0, column.length - STRETCHES_KEPT));
  // The rows do not follow those that are kept, and drawn with them they would be joined over the gap.
  if (head.first !== data.newest + 1) [data.rows, data.rowsClipped] = [[], []];
  data.rows.push(...rows);
  data.rowsClipped.push(...head.rows_clipped);
  [data.rows, data.rowsClipped].forEach((column) => column.splice(0, column.length - ROWS_KEPT));
  data.newest = head.sample;
  data.head = head;
  if (head.timing) takeTiming(head);
  schedule();
}

// Draws soon.
function schedule() {
  if (waiting) return;
  waiting = true;
  const soon = () => requestAnimationFrame(draw);
  if (reducedMotion.matches) setTimeout(soon, REDUCED_MS); else soon();
}


const orNull = (value) => (Number.isNaN(value) ? null : value);

function takeTiming({ time_s, timing }) {
  const { times, columns } = data.timing;
  data.timing.latest = timing;
  times.push(time_s);
  [100 * timing.load, 100 * timing.load_most, timing.late_us, timing.late_most_us].forEach((value, k) => columns[k].push(value));
  [times, ...columns].forEach((column) => column.splice(0, column.length - TIMINGS_KEPT));
}

// The canvases on the screen: others are not drawn, and one that comes onto it is, also when the run is over.
const seen = new Set();
const watching = new IntersectionObserver((entries) => entries.forEach(({ target, isIntersecting }) => {
  if (isIntersecting) { seen.add(target.id); schedule(); } else seen.delete(target.id);
}));
document.querySelectorAll("canvas[id], .plot").forEach((place) => watching.observe(place));

function draw() {
  waiting = false;
  if (data === null || data.head === null) return;
  const begun = performance.now();
  const shown = paused ?? data;
  const { about, head, rows, rowsClipped, spectrum, test, branch, points } = shown;
  const peakHz = spectrum?.peak_hz ?? 0;
  element("time").textContent = `${head.time_s.toFixed(2)} s`;
  // Of the newest data, also while the display is paused: the time bar is of the recording.
  controls.time(data.head.time_s);
  const place = Number(document.querySelector("[name=response]:checked").value);
  // A paused recording shows its current sample.
  const moves = paused === null && (data.player?.playing ?? true);
  const choices = {
    toScale: element("to-scale").checked, slow: moves && element("slow").checked, still: reducedMotion.matches && moves,
  };
  if (seen.has("structure")) views.structure.draw(rows, rowsClipped, shown.newest, about, peakHz, choices);
  const ends = timeWindow.ends(known(shown));
  for (const [id, band] of Object.entries(views.bands)) if (seen.has(id)) band.draw(shown, ends);
  if (seen.has("lissajous")) views.lissajous.draw(rows, rowsClipped, about.rate_hz, peakHz);
  // Spectra come with every eighth update, and stay the same until then.
  if (seen.has("spectrum") && spectrum !== drawn.spectrum) drawSpectrum(spectrum);
  if (seen.has("test") && test !== drawn.test) drawTest(about.test, test);
  if (seen.has("response")) views.response.draw(branch, points, place, about.responses[place], peakHz);
  drawTiming(shown, ends);
  data.frames += 1;
  data.drawing_ms += performance.now() - begun;
}

const drawn = { spectrum: null, test: null };

// What a test has reached, beside what is specified at its level.
function drawTest(plan, test) {
  drawn.test = test;
  const { frequency_hz, demand, low, high, levels_db } = plan;
  const factor = test?.factor ?? 1;
  const scaled = (values) => values.map((value) => factor * value);
  const tolerance = low.length > 0 ? [scaled(low), scaled(high)] : [];
  views.test.draw(frequency_hz, [test?.reached ?? frequency_hz.map(() => null), scaled(demand), ...tolerance]);
  const level = test?.level_db ?? null;
  const levels = levels_db.length > 1 && level !== null ? ` (levels ${levels_db.join(", ")} dB)` : "";
  const state = [
    test?.phase, level === null ? "" : `at ${level} dB${levels}`, test?.full_level_s > 0 ? `${test.full_level_s.toFixed(1)} s at full level` : "",
    test?.frequency_hz ? `${test.frequency_hz.toFixed(2)} Hz` : "",
  ];
  element("test-state").textContent = state.filter((words) => words).join(", ");
  element("test-reached").textContent = test?.words ?? "";
  element("test-stopped").textContent = test?.stopped ? `The controller stops the test: ${test.stopped}` : "";
}

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

function drawTiming({ head, timing }, ends) {
  const { overruns, overrun_causes, lost, lost_updates, viewers } = head;
  const { times, columns, latest } = timing;
  if (seen.has("timing")) views.timing.draw(times, columns, ends);
  const schedule = latest ? `load ${(100 * latest.load).toFixed(1)} %, ${latest.late_us.toFixed(0)} µs late` : "no schedule";
  element("timing-numbers").textContent =
    `${schedule}, ${counted(viewers, "viewer")}, ${counted(lost, "record")} and ${counted(lost_updates, "update")} lost`;
  const causes = overrun_causes.map(([cause, count]) => `${count} ${cause}`).join(", ");
  const missed = `${counted(overruns, "deadline")} missed${causes ? `: ${causes}` : ""}`;
  element("overruns").textContent = latest || overruns > 0 ? missed : "";
}

// Pauses the display: the run goes on, and what is shown stays.
function pause() {
  if (paused === null) {
    // The columns are copied, since updates go on appending to those of `data`.
    const copied = (columns) => columns.map((column) => column.slice());
    const { timing } = data;
    paused = {
      ...data, times: data.times.slice(), least: copied(data.least), largest: copied(data.largest), clipped: data.clipped.slice(),
      rows: data.rows.slice(), rowsClipped: data.rowsClipped.slice(), points: data.points.slice(),
      timing: { ...timing, times: timing.times.slice(), columns: copied(timing.columns) },
    };
    timeWindow.fixed = timeWindow.ends(known(paused));
  }
  showDisplay();
}

function resume() {
  paused = null;
  timeWindow.follow();
  showDisplay();
}

function showDisplay() {
  element("hold").textContent = paused === null ? "Pause display" : "Resume display";
  element("display-state").textContent = paused === null ? "" : `display paused at ${paused.head.time_s.toFixed(2)} s; the run goes on`;
  document.body.classList.toggle("paused", paused !== null);
  schedule();
}

// Changes the stretch of time that is shown; the display pauses there.
function look(change) {
  if (data === null || data.head === null) return;
  pause();
  change(timeWindow.ends(known(paused)));
  schedule();
}

// What a viewer does to a plot over time.
const steering = {
  zoomed: (from_s, to_s) => look(() => timeWindow.show(from_s, to_s)),
  moved: (widths) => look((ends) => timeWindow.move(widths, ends)),
  returned: () => resume(),
};

function prepareDisplay() {
  element("hold").addEventListener("click", () => { if (paused !== null) resume(); else if (data?.head) pause(); });
  element("span").addEventListener("change", () => {
    timeWindow.span_s = Number(element("span").value);
    resume();
  });
  document.querySelectorAll("[data-move]").forEach((button) => {
    button.addEventListener("click", () => steering.moved(Number(button.dataset.move)));
  });
  document.querySelectorAll("[data-zoom]").forEach((button) => {
    button.addEventListener("click", () => look((ends) => timeWindow.zoom(Number(button.dataset.zoom), ends)));
  });
  element("save-csv").addEventListener("click", () => { if (data?.head) saveCsv(exported(), fileName()); });
  element("save-picture").addEventListener("click", () => { if (data?.head) savePicture(fileName()); });
  document.querySelectorAll("#structure-choices input, #responses").forEach((choice) => choice.addEventListener("change", schedule));
  reducedMotion.addEventListener("change", schedule);
}

const fileName = () => `resonarm-${(paused ?? data).head.time_s.toFixed(2)}s`;

// The numbers of the plots over time that are shown, as CSV.
function exported() {
  const shown = paused ?? data;
  const ends = timeWindow.ends(known(shown));
  const channels = [...new Set(Object.values(views.bands).flatMap((band) => band.channels))];
  const width = Math.max(...Object.values(views.bands).map((band) => band.plot.over.clientWidth));
  const inside = columns(shown, channels, ends, width);
  return csv(shown, inside, channels);
}

let heard_ms = performance.now();
let isOpen = false;

function linked(isLinked) {
  isOpen = isLinked;
  heard_ms = performance.now();
  showLink();
}

// Values are current while messages come. A program that was stopped, or a network that was lost, closes no connection.
function showLink() {
  const isSilent = performance.now() - heard_ms > SILENT_MS;
  const wasCurrent = isCurrent;
  isCurrent = isOpen && !isSilent;
  if (!isOver) {
    element("link").textContent = isCurrent ? "connected" : "not connected";
    const since = data?.head ? `: everything below is as it was at ${data.head.time_s.toFixed(2)} s` : "";
    const why = isOpen ? "No data come from the program" : "The connection to the program is lost";
    element("lost").textContent = isCurrent ? "" : `${why}${since}. Connecting again …`;
  } else {
    element("lost").textContent = "";
  }
  const isStale = !isCurrent && !isOver;
  element("lost").hidden = !isStale || data === null;
  document.body.classList.toggle("stale", isStale && data !== null);
  if (wasCurrent !== isCurrent) {
    controls.linked(isCurrent);
    showState();
  }
}

function heard() {
  heard_ms = performance.now();
  if (!isCurrent) showLink();
}

const controls = new Controls((message) => stream.send(message));
const stream = connect({
  received: ({ kind, ...message }) => {
    heard();
    receive[kind]?.(message);
  },
  updated: (buffer) => {
    heard();
    updated(buffer);
  },
  linked,
});
// That messages stay away is no event, so it is looked for.
setInterval(showLink, 500);
prepareDisplay();
// For programs that inspect the page.
window.resonarm = {
  ask: controls.ask, exported, timeWindow, get data() { return data; }, get views() { return views; }, get paused() { return paused; },
};
