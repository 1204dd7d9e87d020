// Drawing on canvases: sharp on every screen, in the page's colours.

let colors = null;
matchMedia("(prefers-color-scheme: dark)").addEventListener("change", () => { colors = null; });

// A colour of page.css, by its name without the dashes.
export function color(name) {
  colors ??= getComputedStyle(document.documentElement);
  return colors.getPropertyValue(`--${name}`).trim();
}

// The canvas cleared and scaled to the screen's pixels: its context, width and height in CSS pixels.
export function begin(canvas) {
  const ratio = devicePixelRatio || 1;
  const [width, height] = [canvas.clientWidth, canvas.clientHeight];
  if (canvas.width !== Math.round(width * ratio) || canvas.height !== Math.round(height * ratio)) {
    canvas.width = Math.round(width * ratio);
    canvas.height = Math.round(height * ratio);
  }
  const context = canvas.getContext("2d");
  context.setTransform(ratio, 0, 0, ratio, 0, 0);
  context.clearRect(0, 0, width, height);
  context.font = "12px system-ui, sans-serif";
  context.lineJoin = "round";
  return { context, width, height };
}

// Round numbers from `low` to `high`, about `count` of them.
function ticks(low, high, count) {
  const rough = (high - low) / count;
  const power = 10 ** Math.floor(Math.log10(rough));
  const step = [1, 2, 5, 10].map((k) => k * power).find((candidate) => candidate >= rough);
  const found = [];
  // Multiples of the step and not sums, which would add up its rounding. The last tick may be beyond the end by such a
  // rounding.
  for (let k = Math.ceil(low / step); k * step <= high + 1e-9 * step; k++) found.push(k * step);
  return { found, digits: Math.max(0, -Math.floor(Math.log10(step) + 1e-9)) };
}

// Axes with grid and labels; the functions that place a number on the canvas.
export function axes({ context, width, height }, [x0, x1], [y0, y1], xLabel, yLabel) {
  const [left, right, top, bottom] = [58, width - 22, 16, height - 36];
  const x = (value) => left + ((value - x0) / (x1 - x0)) * (right - left);
  const y = (value) => bottom - ((value - y0) / (y1 - y0)) * (bottom - top);
  context.strokeStyle = color("grid");
  context.fillStyle = color("faint");
  context.lineWidth = 1;
  context.textAlign = "center";
  const horizontal = ticks(x0, x1, Math.max(2, width / 90));
  for (const value of horizontal.found) {
    line(context, [[x(value), top], [x(value), bottom]]);
    context.fillText(value.toFixed(horizontal.digits), x(value), bottom + 15);
  }
  context.textAlign = "right";
  const vertical = ticks(y0, y1, Math.max(2, height / 50));
  for (const value of vertical.found) {
    line(context, [[left, y(value)], [right, y(value)]]);
    context.fillText(value.toFixed(vertical.digits), left - 5, y(value) + 4);
  }
  context.textAlign = "center";
  context.fillText(xLabel, (left + right) / 2, height - 5);
  context.textAlign = "left";
  context.fillText(yLabel, 4, 11);
  return { x, y };
}

// A line through points; `null` interrupts it.
export function line(context, points) {
  context.beginPath();
  let isFirst = true;
  for (const point of points) {
    if (point === null) { isFirst = true; continue; }
    if (isFirst) context.moveTo(point[0], point[1]); else context.lineTo(point[0], point[1]);
    isFirst = false;
  }
  context.stroke();
}

// Words in the middle of a canvas, in as many lines as they need.
export function words(context, text, width, height) {
  const lines = [""];
  for (const word of text.split(" ")) {
    const longer = `${lines[lines.length - 1]} ${word}`.trim();
    if (context.measureText(longer).width <= width - 24) lines[lines.length - 1] = longer; else lines.push(word);
  }
  context.fillStyle = color("faint");
  context.textAlign = "center";
  lines.forEach((one, k) => context.fillText(one, width / 2, height / 2 + 18 * (k - (lines.length - 1) / 2)));
}

// A unit in which a number is not small: from 0.001 on, of its own or with a prefix.
export function readable(unit, largest) {
  const scales = [[1, ""], [1e3, "m"], [1e6, "µ"], [1e9, "n"]];
  const [factor, prefix] = scales.find(([times]) => largest * times >= 1e-3) ?? scales[0];
  return { factor, unit: `${prefix}${unit}` };
}

// Half the range around a single number, as a fraction of it.
const AROUND_ONE = 0.05;

// The range of numbers with a margin, also around a single one; a default if there is none.
export function range(values, margin, fallback) {
  let [low, high] = [Infinity, -Infinity];
  for (const value of values) {
    if (value === null) continue;
    if (value < low) low = value;
    if (value > high) high = value;
  }
  if (!(high >= low)) return fallback;
  const wide = high > low ? (high - low) * margin : AROUND_ONE * Math.abs(high) || 1;
  return [low - wide, high + wide];
}
