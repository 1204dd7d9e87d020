// Readings beyond the range of their sensor: how the plots that are made of them say so.

// What tells the clipped readings of a sample, among some channels of which each has a name: [channel, name].
export class Clipping {
  constructor(about, named) {
    const bit = (channel) => about.clipped_bits.indexOf(about.channels[channel]);
    this.readings = named.map(([channel, name]) => ({ channel, name, mask: 1 << bit(channel), isReading: bit(channel) >= 0 }));
    this.readings = this.readings.filter((reading) => reading.isReading);
    this.mask = this.readings.reduce((mask, reading) => mask | reading.mask, 0);
  }

  // Whether any of them was clipped in a sample of which `bits` tells.
  has(bits) { return (bits & this.mask) !== 0; }

  // In words, of samples of which `bits` has the clipped readings of each.
  words(bits) {
    const all = bits.reduce((either, one) => either | one, 0);
    const clipped = this.readings.filter(({ mask }) => all & mask).map(({ name }) => name);
    return clipped.length > 0 ? `clipped: ${clipped.join(", ")}` : "";
  }
}
