// Which stretch of time the plots over time show, and the numbers that they draw of it.

// The time span at first, and the least and the largest that zooming gives, s.
const SPAN_S = 8, LEAST_S = 0.02, LARGEST_S = 120;
// Up to so many samples are drawn one by one; of more the envelope is drawn.
const SAMPLES_DRAWN = 2500;
// The envelope covers at least one period of the vibration, but no more than this, s.
const LONGEST_PERIOD_S = 0.25;

// The stretch of time that all plots over time share: it follows the newest sample, or while the display is paused it
// stays where the viewer put it.
export class TimeWindow {
  constructor() { Object.assign(this, { span_s: SPAN_S, fixed: null }); }

  // Its ends, s, for data whose first and last times are these.
  ends([first_s, last_s]) {
    if (this.fixed !== null) return this.fixed;
    const from_s = Math.max(first_s, last_s - this.span_s);
    return [from_s, Math.max(last_s, from_s + LEAST_S)];
  }

  follow() { this.fixed = null; }

  show(from_s, to_s) {
    const span_s = Math.min(LARGEST_S, Math.max(LEAST_S, to_s - from_s));
    const middle_s = (from_s + to_s) / 2;
    this.fixed = [middle_s - span_s / 2, middle_s + span_s / 2];
  }

  // Moves it by so many of its widths, from where it is now.
  move(widths, [from_s, to_s]) {
    const by_s = widths * (to_s - from_s);
    this.show(from_s + by_s, to_s + by_s);
  }

  // Makes it `times` as wide around its middle.
  zoom(times, [from_s, to_s]) {
    const [middle_s, half_s] = [(from_s + to_s) / 2, (times * (to_s - from_s)) / 2];
    this.show(middle_s - half_s, middle_s + half_s);
  }
}

// The first and the last time that is known, s.
export function known({ times, rows, newest, about }) {
  const last_s = newest / about.rate_hz;
  const first_s = rows.length > 0 ? (newest - rows.length + 1) / about.rate_hz : last_s;
  return [times.length > 0 ? Math.min(times[0], first_s) : first_s, last_s];
}

// What a plot of `channels` draws between two times: the samples where there are few enough, else their envelope. The
// columns are `times`, and `least` and `largest` of each channel; `null` interrupts a line.
export function columns(data, channels, [from_s, to_s], pixels) {
  const { rows, newest, about } = data;
  const [first, last] = [Math.floor(from_s * about.rate_hz), Math.ceil(to_s * about.rate_hz)];
  const start = newest - rows.length + 1;
  const isWhole = rows.length > 0 && first >= start - 1 && last - first <= SAMPLES_DRAWN;
  return isWhole ? samples(data, channels, first - start, last - start) : envelope(data, channels, [from_s, to_s], pixels);
}

function samples({ rows, newest, about }, channels, from, to) {
  const start = newest - rows.length + 1;
  const [begin, end] = [Math.max(0, from), Math.min(rows.length, to + 1)];
  const chosen = rows.slice(begin, end);
  const times = chosen.map((_, k) => (start + begin + k) / about.rate_hz);
  const each = channels.map((channel) => chosen.map((row) => (Number.isNaN(row[channel]) ? null : row[channel])));
  return { times, least: each, largest: each, areSamples: true };
}

// The least and the largest values of bins at least as wide as a pixel, each over a whole period of the vibration: bins
// that are shorter than a period see only a part of it, and the parts form patterns that the vibration does not have.
function envelope(data, channels, [from_s, to_s], pixels) {
  const { times, least, largest, head, about } = data;
  const width_s = head.width / about.rate_hz;
  const binned = Math.max(1, Math.ceil((to_s - from_s) / width_s / Math.max(1, pixels)));
  const hertz = Math.min(...[data.spectrum?.peak_hz, about.modes_hz[0]].filter((hz) => hz > 0));
  const period_s = Number.isFinite(hertz) ? Math.min(1 / hertz, LONGEST_PERIOD_S) : 0;
  const bins = Math.max(1, Math.ceil(period_s / (binned * width_s)) + (binned * width_s < period_s ? 1 : 0));
  const margin_s = (bins + 1) * binned * width_s;
  const begin = firstAtOrAfter(times, from_s - margin_s);
  const end = firstAtOrAfter(times, to_s + margin_s);
  // Bins begin at multiples of their width, so that they do not change while the plot moves on.
  const places = [];
  for (let k = begin; k < end; k++) {
    const bin = Math.floor(Math.round(times[k] / width_s) / binned);
    const latest = places[places.length - 1];
    if (latest?.bin === bin) latest.to = k + 1; else places.push({ bin, from: k, to: k + 1 });
  }
  const found = { times: [], least: channels.map(() => []), largest: channels.map(() => []), areSamples: false };
  for (let from = 0; from < places.length;) {
    let to = from + 1;
    while (to < places.length && places[to].bin === places[to - 1].bin + 1) to++;
    if (from > 0) interrupt(found, places[from - 1].bin + 1, binned * width_s);
    const stretch = places.slice(from, to);
    stretch.forEach(({ bin }) => found.times.push((bin + 0.5) * binned * width_s));
    channels.forEach((channel, c) => {
      const low = stretch.map((place) => extreme(least[channel], place, Math.min));
      const high = stretch.map((place) => extreme(largest[channel], place, Math.max));
      found.least[c].push(...held(low, bins, Math.min));
      found.largest[c].push(...held(high, bins, Math.max));
    });
    from = to;
  }
  return found;
}

// Samples are missing here.
function interrupt({ times, least, largest }, bin, width_s) {
  times.push((bin + 0.5) * width_s);
  [...least, ...largest].forEach((column) => column.push(null));
}

function extreme(column, { from, to }, which) {
  let found = null;
  for (let k = from; k < to; k++) if (column[k] !== null) found = found === null ? column[k] : which(found, column[k]);
  return found;
}

// The extreme of the `count` values around each; at the ends of those next to it.
function held(values, count, which) {
  if (count <= 1) return values;
  return values.map((_, k) => {
    const from = Math.max(0, Math.min(k - Math.floor(count / 2), values.length - count));
    return extreme(values, { from, to: Math.min(values.length, from + count) }, which);
  });
}

// The place of the first of ascending `times` that is not before `time_s`.
export function firstAtOrAfter(times, time_s) {
  // By halving, since this is looked for in minutes of stretches for each plot and picture.
  let [low, high] = [0, times.length];
  while (low < high) {
    const middle = (low + high) >> 1;
    if (times[middle] < time_s) low = middle + 1; else high = middle;
  }
  return low;
}
