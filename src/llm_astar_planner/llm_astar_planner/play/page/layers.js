// Pictures of a map with one pixel for each cell; panels scale them.

import { rgb } from './theme.js';

const LEAST_NEWEST = 24;
const NEWEST_PART = 0.03;

class Layer {
  constructor(width, height) {
    this.canvas = document.createElement('canvas');
    this.canvas.width = width;
    this.canvas.height = height;
    this.context = this.canvas.getContext('2d');
    this.image = this.context.createImageData(width, height);
    this.width = width;
    this.height = height;
  }

  /** Set the colour of a cell by its index; rows of cells count from below, of pixels from above. */
  put(index, [red, green, blue], alpha = 255) {
    const y = Math.floor(index / this.width);
    const at = 4 * ((this.height - 1 - y) * this.width + (index - y * this.width));
    this.image.data[at] = red;
    this.image.data[at + 1] = green;
    this.image.data[at + 2] = blue;
    this.image.data[at + 3] = alpha;
  }

  finish() {
    this.context.putImageData(this.image, 0, 0);
  }
}

/** The map with edited walls, and the cells that the robot's radius closes. */
export class MapLayer extends Layer {
  constructor(map) {
    super(map.width, map.height);
    this.map = map;
  }

  /** Draw; `lethal` has 1 for each cell that is closed to the robot, or is null. */
  render(walls, lethal, palette) {
    const colours = Object.fromEntries(['free', 'obstacle', 'unknown', 'inflated', 'wall', 'freed']
      .map((name) => [name, rgb(palette[name])]));
    for (let i = 0; i < this.map.cells.length; i += 1) this.put(i, this.colourOf(i, lethal, colours));
    for (const [index, blocked] of walls?.edits ?? []) {
      if (blocked || !lethal?.[index]) this.put(index, blocked ? colours.wall : colours.freed);
    }
    this.finish();
  }

  colourOf(index, lethal, colours) {
    const value = this.map.cells[index];
    if (value === 255) return lethal?.[index] ? colours.inflated : colours.unknown;
    if (this.map.isBlocked(index)) return colours.obstacle;
    if (lethal?.[index]) return colours.inflated;
    if (!value) return colours.free;
    const part = (value / 100) * 0.7;
    return colours.free.map((from, i) => from + part * (colours.inflated[i] - from));
  }
}

/** The cells that a search has expanded, up to any number of them; the newest stand out. */
export class SearchLayer extends Layer {
  constructor(map, order, isKnown) {
    super(map.width, map.height);
    const size = map.width * map.height;
    const seen = new Uint8Array(size);
    this.order = order.filter((index) => index >= 0 && index < size && !seen[index] && (seen[index] = 1));
    this.isKnown = isKnown;
    this.newest = Math.max(LEAST_NEWEST, Math.round(NEWEST_PART * this.order.length));
    this.count = 0;
    this.palette = null;
  }

  /** Show the first part (0 to 1) of the expansions; an unknown order is shown at once. */
  show(part, palette) {
    const target = this.isKnown ? Math.round(part * this.order.length) : this.order.length;
    const isNew = palette !== this.palette;
    if (target === this.count && !isNew) return;
    const first = isNew ? 0 : Math.max(0, Math.min(this.count, target) - this.newest);
    const last = isNew ? this.order.length : Math.max(this.count, target);
    const hot = target < this.order.length ? target - this.newest : target;
    const colours = [rgb(palette.expanded), rgb(palette.newest)];
    for (let i = first; i < last; i += 1) {
      this.put(this.order[i], colours[Number(i >= hot)], i < target ? 255 : 0);
    }
    this.count = target;
    this.palette = palette;
    this.finish();
  }
}
