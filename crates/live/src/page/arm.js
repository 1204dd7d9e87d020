// The arm in its plane: base, elbow B, tip C; its vibration is drawn magnified and slowed down.

import { begin, color, line } from "./canvas.js";
import { Clipping } from "./clipped.js";

// The largest vibration drawn, rad.
const DRAWN_RAD = 0.22;
// How fast the vibration appears in a stroboscope, Hz: thirty pictures a second of 22 Hz show another motion; lit at its
// frequency less this one, the arm passes slowly through its real shapes.
const APPARENT_HZ = 1;
const [ALPHA1, ALPHA2, B_X, C_X] = [10, 11, 6, 8];

export class ArmView {
  constructor(about, canvas, scaleText, note) {
    const clipping = new Clipping(about, [[B_X, "B x"], [B_X + 1, "B y"], [C_X, "C x"], [C_X + 1, "C y"]]);
    Object.assign(this, { canvas, scaleText, note, clipping, factor: 1, cycles: 0, at: null });
  }

  // The angles of a row; without a plant's angles, from the accelerations across the links at the angular frequency w:
  // α1 = −a_B·n1/(l1 w²), α1 + α2 = −(a_C − a_B)·n2/(l2 w²), n across a link.
  angles(row, about, w) {
    if (!Number.isNaN(row[ALPHA1])) return [row[ALPHA1], row[ALPHA2]];
    if (!(w > 0)) return [0, 0];
    const [l1, l2] = about.lengths_m;
    const [b1, b12] = [about.beta_rad[0], about.beta_rad[0] + about.beta_rad[1]];
    const across = (x, y, angle) => y * Math.cos(angle) - x * Math.sin(angle);
    const first = -across(row[B_X], row[B_X + 1], b1) / (l1 * w * w);
    const both = -across(row[C_X] - row[B_X], row[C_X + 1] - row[B_X + 1], b12) / (l2 * w * w);
    return [first, both - first];
  }

  // Elbow and tip at these angles, m.
  points([a1, a2], about) {
    const [first, second] = [about.beta_rad[0] + a1, about.beta_rad[0] + about.beta_rad[1] + a1 + a2];
    const b = [about.lengths_m[0] * Math.cos(first), about.lengths_m[0] * Math.sin(first)];
    return [b, [b[0] + about.lengths_m[1] * Math.cos(second), b[1] + about.lengths_m[1] * Math.sin(second)]];
  }

  // The latest row, or with the stroboscope the row whose phase (of the strongest vibration at `peakHz`) is that of a
  // slow clock. The phase of the latest sample is continued from frame to frame.
  chosen(rows, newest, about, peakHz, stroboscope) {
    const last = rows.length - 1;
    if (!stroboscope || !(peakHz > APPARENT_HZ) || rows.length < 2 * about.rate_hz / peakHz) return rows[last];
    const passed = this.at === null ? 0 : Math.max(0, newest - this.at);
    this.cycles = (this.cycles + (passed / about.rate_hz) * peakHz) % 1;
    this.at = newest;
    const slow = (performance.now() / 1000) * APPARENT_HZ;
    const back = (((this.cycles - slow) % 1) + 1) % 1;
    return rows[Math.max(0, last - Math.round((back / peakHz) * about.rate_hz))];
  }

  draw(rows, clipped, newest, about, peakHz, { toScale, stroboscope }) {
    const drawing = begin(this.canvas);
    const { context, width, height } = drawing;
    const reach = about.lengths_m[0] + about.lengths_m[1];
    const rest = this.points([0, 0], about);
    const [xs, ys] = [0, 1].map((axis) => [0, rest[0][axis], rest[1][axis]]);
    const pad = 0.3 * reach;
    const box = [Math.min(...xs) - pad, Math.max(...xs) + pad, Math.min(...ys) - pad, Math.max(...ys) + pad];
    const scale = Math.min(width / (box[1] - box[0]), height / (box[3] - box[2]));
    const place = ([x, y]) => [
      width / 2 + (x - (box[0] + box[1]) / 2) * scale, height / 2 - (y - (box[2] + box[3]) / 2) * scale,
    ];
    const w = 2 * Math.PI * peakHz;
    const period = peakHz > 0 ? Math.ceil(about.rate_hz / peakHz) : 1;
    const shown = rows.slice(-Math.max(period, 2));
    const latest = shown.map((row) => this.angles(row, about, w));
    // A plant's own angles do not depend on readings.
    const isRead = shown.length > 0 && Number.isNaN(shown[shown.length - 1][ALPHA1]);
    this.note.textContent = isRead ? this.clipping.words(clipped.slice(-shown.length)) : "";
    this.rescale(latest, toScale);
    const larger = (angles) => angles.map((angle) => angle * this.factor);
    context.strokeStyle = color("grid");
    context.lineWidth = 2;
    line(context, [[0, 0], ...rest].map(place));
    context.strokeStyle = color("third");
    context.lineWidth = 1;
    line(context, latest.map((angles) => place(this.points(larger(angles), about)[1])));
    const row = this.chosen(rows, newest, about, peakHz, stroboscope);
    const [b, c] = this.points(row ? larger(this.angles(row, about, w)) : [0, 0], about).map(place);
    this.links(context, place([0, 0]), b, c);
    this.scaleText.textContent = this.factor === 1 ? "to scale" : `vibration ×${this.factor.toLocaleString("en")}`;
    this.tip = c;
  }

  // The magnification: 1, 2, 5, 10 … so that the largest angle is clearly visible.
  rescale(latest, toScale) {
    const largest = latest.reduce((most, [a1, a2]) => Math.max(most, Math.abs(a1), Math.abs(a1 + a2)), 0);
    if (toScale) { this.factor = 1; return; }
    if (!(largest > 1e-9)) return;
    const wanted = DRAWN_RAD / largest;
    if (this.factor > 1 && wanted >= this.factor * 0.8 && wanted < this.factor * 3.2) return;
    const power = 10 ** Math.floor(Math.log10(wanted));
    this.factor = Math.max(1, power * [5, 2, 1].find((digit) => digit * power <= wanted));
  }

  links(context, base, b, c) {
    context.lineCap = "round";
    context.strokeStyle = color("first");
    context.lineWidth = 9;
    line(context, [base, b]);
    context.strokeStyle = color("second");
    context.lineWidth = 7;
    line(context, [b, c]);
    context.lineCap = "butt";
    context.fillStyle = color("text");
    for (const [[x, y], radius, name] of [[base, 7, ""], [b, 5, "B"], [c, 4, "C"]]) {
      context.beginPath();
      context.arc(x, y, radius, 0, 2 * Math.PI);
      context.fill();
      context.fillText(name, x + 9, y - 8);
    }
  }
}
