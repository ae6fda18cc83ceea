// A map as the page draws it: cells, coordinates for people, places.

import { bytes, number, points, text } from './codec.js';

const MAX_CELLS = 4_000_000;
// Occupancy from which a cell is an obstacle, and that of an unknown one.
export const OCCUPIED = 65;
export const UNKNOWN = 255;

export class GridMap {
  /** Take a map as the server sends it. Throws an Error that says what is wrong with it. */
  constructor(raw) {
    this.id = text(raw.id, 300);
    this.name = text(raw.name, 120);
    this.width = raw.width;
    this.height = raw.height;
    const size = this.width * this.height;
    if (!(Number.isInteger(size) && size > 0 && size <= MAX_CELLS))
      throw new Error('The map has no size that can be shown.');
    this.cells = bytes(raw.cells);
    if (this.cells.length !== size) throw new Error('The map is incomplete.');
    this.resolution = number(raw.resolution) ?? 1;
    this.isMetric = raw.unit === 'm';
    this.origin = [0, 1, 2].map((i) => number(raw.origin?.[i]) ?? 0);
    this.offset = [0, 1].map((i) => number(raw.offset?.[i]) ?? 0);
    this.pairs = (Array.isArray(raw.pairs) ? raw.pairs : [])
      .slice(0, 10)
      .filter((pair) => this.has(pair.start) && this.has(pair.goal));
    this.places = (Array.isArray(raw.places) ? raw.places : [])
      .slice(0, 400)
      .map((place) => ({ name: text(place.name, 80), polygon: points(place.polygon, 2000) }));
    // The places as they are in a file, to be saved with others.
    this.features = Array.isArray(raw.geojson?.features) ? raw.geojson.features : [];
  }

  has(cell) {
    return (
      Array.isArray(cell) &&
      Number.isInteger(cell[0]) &&
      Number.isInteger(cell[1]) &&
      cell[0] >= 0 &&
      cell[1] >= 0 &&
      cell[0] < this.width &&
      cell[1] < this.height
    );
  }

  isBlocked(index) {
    return this.cells[index] >= OCCUPIED && this.cells[index] !== UNKNOWN;
  }

  isUnknown(index) {
    return this.cells[index] === UNKNOWN;
  }

  clamped([x, y]) {
    return [Math.min(this.width - 1, Math.max(0, x)), Math.min(this.height - 1, Math.max(0, y))];
  }

  /** What is the same for all maps whose cells are the same places. */
  get layout() {
    return [this.width, this.height, this.resolution, ...this.origin].join(' ');
  }

  /** Whether the axes are those of the map's frame: those of a turned map count from its corner. */
  get isUpright() {
    return Math.abs(this.origin[2]) < 1e-9;
  }

  /** Return what the axes say at a cell coordinate (the centre of cell n is n). */
  axisValue(axis, cell) {
    if (!this.isMetric) return cell + this.offset[axis];
    return (this.isUpright ? this.origin[axis] : 0) + (cell + 0.5) * this.resolution;
  }

  axisName(axis) {
    const name = axis === 0 ? 'x' : 'y';
    if (!this.isMetric) return `${name} (cells)`;
    return this.isUpright ? `${name} (m)` : `${name} from the corner (m)`;
  }

  /** Return the metres in the map's frame of a point in cells. */
  toWorld([x, y]) {
    const [left, bottom, yaw] = this.origin;
    const [dx, dy] = [(x + 0.5) * this.resolution, (y + 0.5) * this.resolution];
    const [cos, sin] = [Math.cos(yaw), Math.sin(yaw)];
    return [left + cos * dx - sin * dy, bottom + sin * dx + cos * dy];
  }

  /** Return the point in cells of metres in the map's frame. */
  toGrid([x, y]) {
    const [left, bottom, yaw] = this.origin;
    const [cos, sin] = [Math.cos(yaw), Math.sin(yaw)];
    const [dx, dy] = [x - left, y - bottom];
    return [
      (cos * dx + sin * dy) / this.resolution - 0.5,
      (cos * dy - sin * dx) / this.resolution - 0.5,
    ];
  }

  /** Return a cell in words. */
  described([x, y]) {
    const cell = `${x + this.offset[0]}, ${y + this.offset[1]}`;
    if (!this.isMetric) return cell;
    const metres = [x, y].map((value, axis) => this.axisValue(axis, value).toFixed(2)).join(', ');
    return `${metres} m (cell ${cell})`;
  }

  /** Return two free cells far apart, for a map without examples. */
  defaultPair() {
    if (this.pairs.length) return this.pairs[0];
    const free = [];
    for (let i = 0; i < this.cells.length; i += 1) if (this.cells[i] < OCCUPIED) free.push(i);
    const at = (part) => {
      const index = free[Math.floor(free.length * part)] ?? 0;
      return [index % this.width, Math.floor(index / this.width)];
    };
    return { start: at(0.15), goal: at(0.85) };
  }
}
