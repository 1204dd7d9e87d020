// The structure under test, its vibration drawn magnified and slowed down: links from the base to the tip, or the points
// of modes and the lines between them.

import { begin, color, line, words } from "./canvas.js";
import { Clipping } from "./clipped.js";
import { Drawing } from "./drawing.js";

// How fast the vibration appears in slow motion, Hz: thirty pictures a second of 22 Hz show another motion; seen at its
// frequency less this one, the structure passes slowly through its real shapes.
const APPARENT_HZ = 1;
const [B_X, C_X] = [6, 8];
// The most rows that the magnification is chosen by.
const ROWS_WEIGHED = 100;
// With more points only those of the rig have their names.
const POINTS_NAMED = 12;
const PLACELESS = "the positions of its points are unknown: give them in [structure.points] of the scenario";
const FOREIGN = "a program's own structure, or an FMU, is not drawn";

export class StructureView {
  constructor(about, canvas, scaleText, note) {
    const clipping = new Clipping(about, [[B_X, "B x"], [B_X + 1, "B y"], [C_X, "C x"], [C_X + 1, "C y"]]);
    const drawing = about.drawing && new Drawing(about.drawing);
    Object.assign(this, { canvas, scaleText, note, clipping, drawing, factor: 1, cycles: 0, at: null });
    this.names = drawing ? names(about, drawing) : [];
    // The point whose path is drawn.
    this.followed = Math.max(0, drawing ? drawing.points.indexOf(about.rig?.[2]) : 0);
  }

  // The coordinates of a row; `null` if they are unknown. Without those of a plant the angles of two links follow from the
  // accelerations across them at the angular frequency w: α1 = −a_B·n1/(l1 w²), α1 + α2 = −(a_C − a_B)·n2/(l2 w²), n
  // across a link.
  coordinates(row, about, w) {
    const { first, count } = about.coordinates;
    if (!Number.isNaN(row[first])) return [...row.slice(first, first + count)];
    if (!about.angles_are_read) return null;
    if (!(w > 0)) return [0, 0];
    const { lengths_m: [l1, l2], angles_rad: [b1, b12] } = this.drawing.links;
    const across = (x, y, angle) => y * Math.cos(angle) - x * Math.sin(angle);
    const one = -across(row[B_X], row[B_X + 1], b1) / (l1 * w * w);
    const both = -across(row[C_X] - row[B_X], row[C_X + 1] - row[B_X + 1], b12) / (l2 * w * w);
    return [one, both - one];
  }

  // The latest row, or in slow motion the row whose phase (of the strongest vibration at `peakHz`) is that of a
  // slow clock. The phase of the latest sample is continued from frame to frame.
  chosen(rows, newest, about, peakHz, slow) {
    const last = rows.length - 1;
    if (!slow || !(peakHz > APPARENT_HZ) || rows.length < 2 * about.rate_hz / peakHz) return rows[last];
    const passed = this.at === null ? 0 : Math.max(0, newest - this.at);
    this.cycles = (this.cycles + (passed / about.rate_hz) * peakHz) % 1;
    this.at = newest;
    const phase = (performance.now() / 1000) * APPARENT_HZ;
    const back = (((this.cycles - phase) % 1) + 1) % 1;
    return rows[Math.max(0, last - Math.round((back / peakHz) * about.rate_hz))];
  }

  // `still` shows the largest vibration of a period, which does not move, to viewers who prefer that.
  draw(rows, clipped, newest, about, peakHz, { toScale, slow, still }) {
    const { context, width, height } = begin(this.canvas);
    const { drawing } = this;
    if (!drawing) {
      words(context, about.rig ? PLACELESS : FOREIGN, width, height);
      this.scaleText.textContent = "not drawn";
      return;
    }
    const w = 2 * Math.PI * peakHz;
    const period = peakHz > 0 ? Math.ceil(about.rate_hz / peakHz) : 1;
    const shown = rows.slice(-Math.max(period, 2));
    // A plant's own coordinates do not depend on readings.
    const isRead = shown.length > 0 && Number.isNaN(shown[shown.length - 1][about.coordinates.first]);
    this.note.textContent = isRead && about.angles_are_read ? this.clipping.words(clipped.slice(-shown.length)) : "";
    const latest = shown.map((row) => this.coordinates(row, about, w)).filter((coordinates) => coordinates !== null);
    this.rescale(latest, toScale);
    const place = drawing.placing(width, height);
    const rest = drawing.rest_m.map(place);
    const row = this.chosen(rows, newest, about, peakHz, slow);
    const now = still && latest.length > 0 ? furthest(latest) : row && this.coordinates(row, about, w);
    const points = now ? drawing.positions(now, this.factor).map(place) : rest;
    this.still(context, rest);
    context.strokeStyle = color("third");
    context.lineWidth = 1;
    line(context, latest.map((coordinates) => place(drawing.position(this.followed, coordinates, this.factor))));
    if (drawing.links) this.links(context, points); else this.lines(context, rest, points);
    this.labels(context, points, width);
    frame(context, drawing, height);
    this.scaleText.textContent = this.scale(isRead && !about.angles_are_read, toScale);
    this.tip = points[this.followed];
  }

  scale(isUnknown, toScale) {
    if (isUnknown) return "at rest: an exciter does not know the coordinates";
    return toScale ? "to scale" : `vibration ×${this.factor.toLocaleString("en")}`;
  }

  // The magnification: 1, 2, 5, 10 … so that the largest vibration is clearly visible.
  rescale(latest, toScale) {
    if (toScale) { this.factor = 1; return; }
    const step = Math.ceil(latest.length / ROWS_WEIGHED);
    const weighed = latest.filter((_, k) => k % step === 0);
    const largest = weighed.reduce((most, coordinates) => Math.max(most, this.drawing.vibration(coordinates)), 0);
    // At rest the noise of a few bits would be magnified to the size of the picture.
    if (!(largest > 5e-9)) return;
    const wanted = 1 / largest;
    // Kept while it is about right: a factor that changed with every period would hide whether the vibration grows. The
    // range is wider than a step, so that two factors do not alternate (moving.rs).
    if (this.factor > 1 && wanted >= this.factor * 0.8 && wanted < this.factor * 3.2) return;
    const power = 10 ** Math.floor(Math.log10(wanted));
    this.factor = Math.max(1, power * [5, 2, 1].find((digit) => digit * power <= wanted));
  }

  // The structure at rest.
  still(context, rest) {
    context.strokeStyle = context.fillStyle = color("grid");
    context.lineWidth = 2;
    for (const along of this.drawing.lines) line(context, along.map((point) => rest[point]));
    if (!this.drawing.links) rest.forEach((point) => dot(context, point, 4));
  }

  links(context, points) {
    context.lineCap = "round";
    points.slice(1).forEach((end, link) => {
      context.strokeStyle = color(link % 2 ? "second" : "first");
      context.lineWidth = link === 0 ? 9 : 7;
      line(context, [points[link], end]);
    });
    context.lineCap = "butt";
    context.fillStyle = color("text");
    const last = points.length - 1;
    points.forEach((point, k) => dot(context, point, k === 0 ? 7 : k === last ? 4 : 5));
  }

  // Without lines it is shown how far each point is from rest.
  lines(context, rest, points) {
    const all = this.drawing.lines.map((along) => along.map((point) => points[point]));
    context.strokeStyle = color("first");
    context.lineWidth = 3;
    for (const along of all.length > 0 ? all : points.map((point, k) => [rest[k], point])) line(context, along);
    context.fillStyle = color("text");
    points.forEach((point) => dot(context, point, 4));
  }

  // Names beside the points, those of the rig first; one that would lie on another is left out.
  labels(context, points, width) {
    const taken = [];
    context.fillStyle = color("text");
    for (const { point, name } of this.names) {
      const wide = context.measureText(name).width;
      const [x, y] = [Math.min(points[point][0] + 9, width - wide - 4), points[point][1] - 8];
      const covers = ([left, right, top]) => x < right && x + wide > left && Math.abs(y - top) < 13;
      if (taken.some(covers)) continue;
      taken.push([x, x + wide, y]);
      context.fillText(name, x, y);
    }
  }
}

// The row of a period at which the coordinate that moves most is largest: always the same side of the vibration.
function furthest(rows) {
  const most = rows[0].map((_, k) => rows.reduce((largest, row) => Math.max(largest, Math.abs(row[k])), 0));
  const moving = most.indexOf(Math.max(...most));
  return rows.reduce((one, other) => (other[moving] > one[moving] ? other : one));
}

// What is written beside points: what of the rig is there, and the name of the point.
function names(about, drawing) {
  const rig = about.rig ?? [];
  // If the force acts at C, one letter there is enough.
  const parts = rig[0] === rig[2] ? [[1, "B"], [2, "C"]] : [[1, "B"], [2, "C"], [0, "load"]];
  const named = drawing.points.map((name, point) => {
    const at = parts.filter(([part]) => rig[part] === name).map(([, letter]) => letter);
    return { point, at, name: `${at.join(", ")} ${name}`.trim() };
  });
  const all = !drawing.links && named.length <= POINTS_NAMED;
  const ofRig = named.filter(({ at }) => at.length > 0);
  return all ? [...ofRig, ...named.filter(({ at }) => at.length === 0)] : ofRig;
}

// The axes of the base frame, in the lower left corner.
function frame(context, drawing, height) {
  const [x, y] = [26, height - 26];
  context.strokeStyle = context.fillStyle = color("faint");
  context.lineWidth = 1;
  for (const [name, across, down] of drawing.frame()) {
    line(context, [[x, y], [x + 18 * across, y + 18 * down]]);
    context.fillText(name, x + 25 * across - 3, y + 25 * down + 4);
  }
}

function dot(context, [x, y], radius) {
  context.beginPath();
  context.arc(x, y, radius, 0, 2 * Math.PI);
  context.fill();
}
