// What is drawn on the map, with undo: walls, costs, erased cells, places and zones.

import { OCCUPIED } from './gridmap.js';

export const WALL = 100;
export const FREE = 0;
export const MAX_EDITED = 60_000;
const MAX_STROKES = 200;

export class Edits {
  constructor(map) {
    this.map = map;
    // Cell index -> occupancy, 0 to 100, where that differs from the map.
    this.cells = new Map();
    // Places and zones as features of GeoJSON, in metres of the map's frame.
    this.features = [];
    this.done = [];
    this.undone = [];
    this.stroke = null;
  }

  /** Return the occupancy of a cell, 255 for unknown. */
  valueOf(index) {
    return this.cells.get(index) ?? this.map.cells[index];
  }

  isBlocked(index) {
    return this.cells.has(index) ? this.cells.get(index) >= OCCUPIED : this.map.isBlocked(index);
  }

  get isEdited() {
    return this.cells.size > 0 || this.features.length > 0;
  }

  /** Begin what one undo takes back. */
  begin() {
    this.stroke = new Map();
  }

  /** Give a square of `size` cells around a cell an occupancy. Returns false at the limit. */
  paint([x, y], size, occupancy) {
    const reach = (size - 1) / 2;
    for (let dy = -reach; dy <= reach; dy += 1) {
      for (let dx = -reach; dx <= reach; dx += 1) {
        const cell = [x + dx, y + dy];
        if (this.map.has(cell) && !this.put(cell[1] * this.map.width + cell[0], occupancy))
          return false;
      }
    }
    return true;
  }

  put(index, occupancy) {
    // A cost is for cells that can be driven on.
    if (occupancy > FREE && occupancy < OCCUPIED && this.isBlocked(index)) return true;
    const before = this.cells.get(index);
    const after = occupancy === this.map.cells[index] ? undefined : occupancy;
    if (before === after) return true;
    if (before === undefined && this.cells.size >= MAX_EDITED) return false;
    if (!this.stroke.has(index)) this.stroke.set(index, { before, after });
    else this.stroke.get(index).after = after;
    this.set(index, after);
    return true;
  }

  set(index, value) {
    if (value === undefined) this.cells.delete(index);
    else this.cells.set(index, value);
  }

  /** End the stroke. Returns whether it changed anything. */
  end() {
    const stroke = this.stroke;
    this.stroke = null;
    if (!stroke?.size) return false;
    this.remember(stroke);
    return true;
  }

  remember(stroke) {
    this.done = [...this.done.slice(1 - MAX_STROKES), stroke];
    this.undone = [];
  }

  /** Take other places and zones, as one stroke. */
  setFeatures(features) {
    this.remember(new Map([['features', { before: this.features, after: features }]]));
    this.features = features;
  }

  undo() {
    this.step(this.done, this.undone, 'before');
  }

  redo() {
    this.step(this.undone, this.done, 'after');
  }

  step(from, to, side) {
    const stroke = from.pop();
    if (!stroke) return;
    for (const [index, change] of stroke) {
      if (index === 'features') this.features = change[side];
      else this.set(index, change[side]);
    }
    to.push(stroke);
  }

  /** Take all edits back, as one stroke. */
  clear() {
    const stroke = new Map([['features', { before: this.features, after: [] }]]);
    for (const [index, before] of this.cells) stroke.set(index, { before, after: undefined });
    this.remember(stroke);
    this.cells.clear();
    this.features = [];
  }

  /** Return the occupancies that were drawn, each once. */
  levels() {
    return [...new Set(this.cells.values())].sort((a, b) => a - b);
  }

  /** Return the sorted indices of the cells that were given an occupancy. */
  indices(occupancy) {
    return [...this.cells]
      .filter(([, value]) => value === occupancy)
      .map(([index]) => index)
      .sort((a, b) => a - b);
  }

  /** Return the cells as the server takes them: [x, y, occupancy]. */
  toRequest() {
    const { width } = this.map;
    return [...this.cells].map(([index, value]) => [
      index % width,
      Math.floor(index / width),
      value,
    ]);
  }
}
