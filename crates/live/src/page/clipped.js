// Readings beyond the range of their sensor, as shown in the plots made from them.

// Names the clipped readings of a sample, for some channels with names: [channel, name].
export class Clipping {
  constructor(about, named) {
    const bit = (channel) => about.clipped_bits.indexOf(about.channels[channel]);
    this.readings = named.map(([channel, name]) => ({ channel, name, mask: 1 << bit(channel), isReading: bit(channel) >= 0 }));
    this.readings = this.readings.filter((reading) => reading.isReading);
    this.mask = this.readings.reduce((mask, reading) => mask | reading.mask, 0);
  }

  // Whether any of them was clipped in a sample with these bits.
  has(bits) { return (bits & this.mask) !== 0; }

  // In words, for samples with these bits each.
  words(bits) {
    const all = bits.reduce((either, one) => either | one, 0);
    const clipped = this.readings.filter(({ mask }) => all & mask).map(({ name }) => name);
    return clipped.length > 0 ? `clipped: ${clipped.join(", ")}` : "";
  }
}
