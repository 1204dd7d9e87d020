// Where the points of a drawing are in a motion, and where in the picture (crates/files/src/drawing.rs).

// The largest vibration that is drawn: of links their turn, rad, of modes the displacement over the size.
// The same numbers as in drawing.rs, so that the page and the Foxglove stream magnify alike.
const DRAWN_RAD = 0.22;
const DRAWN_OF_SIZE = 0.12;
// A drawing with depth is seen from in front and above, turned about z and towards the viewer, rad.
const YAW = 0.45, PITCH = 0.4;

const dot = (a, b) => a.reduce((sum, value, k) => sum + value * b[k], 0);

export class Drawing {
  constructor({ points, rest_m, lines, motion }) {
    Object.assign(this, { points, rest_m, lines, links: motion.links, shapes: motion.shapes });
    const along = (axis) => rest_m.map((point) => point[axis]);
    const ranges = [0, 1, 2].map((axis) => Math.max(...along(axis)) - Math.min(...along(axis)));
    this.size = Math.hypot(...ranges) || 1;
    // How far the picture goes beyond the points at rest.
    this.margin = 0.3 * (this.links ? this.links.lengths_m.reduce((sum, length) => sum + length, 0) : this.size);
    this.isFlat = ranges[2] === 0 && !this.shapes?.some((shape) => shape[2].some((value) => value !== 0));
  }

  // The points with the vibration `factor` times as large, m: links turn, modes move the points along their shapes.
  positions(coordinates, factor) {
    if (!this.links) return this.rest_m.map((_, point) => this.position(point, coordinates, factor));
    let [turn, [x, y, z]] = [0, this.rest_m[0]];
    const ends = this.links.lengths_m.map((length, link) => {
      turn += factor * coordinates[link];
      const angle = this.links.angles_rad[link] + turn;
      [x, y] = [x + length * Math.cos(angle), y + length * Math.sin(angle)];
      return [x, y, z];
    });
    return [this.rest_m[0], ...ends];
  }

  // One of them.
  position(point, coordinates, factor) {
    if (this.links) return this.positions(coordinates, factor)[point];
    return this.rest_m[point].map((place, axis) => place + factor * dot(this.shapes[point][axis], coordinates));
  }

  // The vibration over the largest that is drawn.
  vibration(coordinates) {
    if (!this.links) {
      const far = this.shapes.map((shape) => Math.hypot(...shape.map((along) => dot(along, coordinates))));
      return Math.max(...far) / (DRAWN_OF_SIZE * this.size);
    }
    let [turn, most] = [0, 0];
    for (const deflection of coordinates) most = Math.max(most, Math.abs(turn += deflection));
    return most / DRAWN_RAD;
  }

  // A point in the plane of the picture, m: without depth x to the right and y up, else z up.
  plane([x, y, z]) {
    if (this.isFlat) return [x, y];
    const depth = y * Math.cos(YAW) - x * Math.sin(YAW);
    return [x * Math.cos(YAW) + y * Math.sin(YAW), z * Math.cos(PITCH) + depth * Math.sin(PITCH)];
  }

  // The function that places points on a canvas of that size, so that all are on it.
  placing(width, height) {
    const flat = this.rest_m.map((point) => this.plane(point));
    const [xs, ys] = [flat.map(([x]) => x), flat.map(([, y]) => y)];
    const box = [Math.min(...xs), Math.max(...xs), Math.min(...ys), Math.max(...ys)];
    const [wide, high] = [box[1] - box[0] + 2 * this.margin, box[3] - box[2] + 2 * this.margin];
    const scale = Math.min(width / wide, height / high);
    return (point) => {
      const [x, y] = this.plane(point);
      return [width / 2 + (x - (box[0] + box[1]) / 2) * scale, height / 2 - (y - (box[2] + box[3]) / 2) * scale];
    };
  }

  // The axes of the base frame in the picture, [name, x, y] with y down.
  frame() {
    const axes = [["x", [1, 0, 0]], ["y", [0, 1, 0]], ["z", [0, 0, 1]]].slice(0, this.isFlat ? 2 : 3);
    return axes.map(([name, axis]) => {
      const [x, y] = this.plane(axis);
      return [name, x, -y];
    });
  }
}
