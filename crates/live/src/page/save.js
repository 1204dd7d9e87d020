// Saves what is shown: the numbers of the plots over time as CSV, and the panels as a picture.

import { color } from "./canvas.js";

function save(blob, name) {
  const link = document.createElement("a");
  link.href = URL.createObjectURL(blob);
  link.download = name;
  document.body.append(link);
  link.click();
  link.remove();
  // The browser has begun to read it by then.
  setTimeout(() => URL.revokeObjectURL(link.href), 60_000);
}

// The columns of the plots over time as they are drawn, as text: of samples one column a channel, of an envelope two.
export function csv(data, { times, least, largest, areSamples }, channels) {
  const names = channels.map((channel) => data.about.channels[channel]);
  const header = ["time_s", ...names.flatMap((name) => (areSamples ? [name] : [`${name}_least`, `${name}_largest`]))];
  const lines = times.map((time_s, k) => [
    Number(time_s.toFixed(9)), ...channels.flatMap((_, c) => (areSamples ? [least[c][k]] : [least[c][k], largest[c][k]])),
  ].map((value) => value ?? "").join(","));
  return `${[header.join(","), ...lines].join("\n")}\n`;
}

export function saveCsv(text, name) {
  save(new Blob([text], { type: "text/csv" }), `${name}.csv`);
}

// The panels where they are on the page, as one picture in the pixels of the screen.
export async function savePicture(name) {
  const main = document.querySelector("main");
  const origin = main.getBoundingClientRect();
  const ratio = devicePixelRatio || 1;
  const picture = document.createElement("canvas");
  [picture.width, picture.height] = [Math.ceil(origin.width * ratio), Math.ceil(origin.height * ratio)];
  const context = picture.getContext("2d");
  context.scale(ratio, ratio);
  context.fillStyle = color("ground");
  context.fillRect(0, 0, origin.width, origin.height);
  const at = (element) => {
    const { left, top, width, height } = element.getBoundingClientRect();
    return [left - origin.left, top - origin.top, width, height];
  };
  // The text of an element, in the colour of another: names of curves are in the colour of their mark.
  const write = (coloured, element, x, y, font = "12px sans-serif") => {
    context.font = font;
    context.fillStyle = getComputedStyle(coloured).color;
    context.fillText(element.innerText.trim(), x, y);
  };
  for (const section of document.querySelectorAll("main section[data-panel]:not([hidden])")) {
    context.fillStyle = color("panel");
    context.fillRect(...at(section));
    const title = section.querySelector("h2");
    const [x, y] = at(title);
    write(title, title, x, y + 14, "bold 14px sans-serif");
    for (const canvas of section.querySelectorAll("canvas")) context.drawImage(canvas, ...at(canvas));
    for (const entry of section.querySelectorAll(".legend button[aria-pressed=true], .key > span, .numbers")) {
      const [left, top, , height] = at(entry);
      // A key that the page does not show has no height.
      if (height > 0) write(entry.querySelector("i") ?? entry, entry, left, top + height / 2 + 4);
    }
  }
  save(await new Promise((taken) => picture.toBlob(taken, "image/png")), `${name}.png`);
}
