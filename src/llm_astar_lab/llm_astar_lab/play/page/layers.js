// Pictures of a map with one pixel for each cell; panels scale them.

import { OCCUPIED, UNKNOWN } from './gridmap.js';
import { rgb } from './theme.js';

// Expansions that the server sends at most.
export const MAX_ORDER = 1_000_000;
const LEAST_NEWEST = 24;
const NEWEST_PART = 0.03;
// How much of the colour of closed cells the costliest passable one has.
const COST_PART = 0.7;

/** Return a colour as a pixel, which canvases keep as bytes red, green, blue, alpha. */
function pixelOf([red, green, blue]) {
  return ((255 << 24) | (blue << 16) | (green << 8) | red) >>> 0;
}

class Layer {
  constructor(width, height) {
    this.canvas = document.createElement('canvas');
    this.canvas.width = width;
    this.canvas.height = height;
    this.context = this.canvas.getContext('2d');
    this.image = this.context.createImageData(width, height);
    this.pixels = new Uint32Array(this.image.data.buffer);
    this.width = width;
    this.height = height;
  }

  /** Set the pixel of a cell by its index; rows of cells count from below, of pixels from above. */
  put(index, pixel) {
    const y = Math.floor(index / this.width);
    this.pixels[(this.height - 1 - y) * this.width + (index - y * this.width)] = pixel;
  }

  finish() {
    this.context.putImageData(this.image, 0, 0);
  }
}

/** The map with what is drawn on it, and the cells that the robot's radius closes. */
export class MapLayer extends Layer {
  constructor(map) {
    super(map.width, map.height);
    this.map = map;
  }

  /** Draw all; `lethal` has 1 for each cell that is closed to the robot, or is null. */
  render(edits, lethal, palette) {
    this.lethal = lethal;
    this.setColours(palette);
    const { cells } = this.map;
    for (let y = 0; y < this.height; y += 1) {
      const row = (this.height - 1 - y) * this.width;
      for (let x = 0, index = y * this.width; x < this.width; x += 1, index += 1) {
        const value = cells[index];
        this.pixels[row + x] =
          lethal?.[index] && !this.isSolid[value] ? this.closed : this.ofValue[value];
      }
    }
    this.paint(edits, edits?.cells.keys() ?? []);
  }

  setColours(palette) {
    const [free, inflated] = [rgb(palette.free), rgb(palette.inflated)];
    const mixed = (part, other = inflated) =>
      pixelOf(free.map((from, i) => Math.round(from + part * (other[i] - from))));
    this.isSolid = Uint8Array.from(
      { length: 256 },
      (_, value) => value >= OCCUPIED && value !== UNKNOWN,
    );
    this.ofValue = Uint32Array.from({ length: 256 }, (_, value) =>
      mixed((COST_PART * value) / 100),
    );
    this.ofValue.fill(pixelOf(rgb(palette.obstacle)), OCCUPIED);
    this.ofValue[UNKNOWN] = pixelOf(rgb(palette.unknown));
    const [wall, freed] = [rgb(palette.wall), rgb(palette.freed)];
    this.closed = pixelOf(inflated);
    this.ofDrawn = Uint32Array.from({ length: OCCUPIED }, (_, value) => mixed(value / 100, wall));
    this.ofDrawn[0] = pixelOf(freed);
    this.wall = pixelOf(wall);
  }

  /** Draw some cells again, by their indices. */
  paint(edits, indices) {
    for (const index of indices) this.put(index, this.pixelAt(index, edits.cells.get(index)));
    this.finish();
  }

  pixelAt(index, drawn) {
    const value = this.map.cells[index];
    if (drawn >= OCCUPIED) return this.wall;
    const isOpen = drawn !== undefined || !this.isSolid[value];
    if (this.lethal?.[index] && isOpen) return this.closed;
    return drawn === undefined ? this.ofValue[value] : this.ofDrawn[drawn];
  }
}

/** The cells that a search has expanded, up to any number of them; the newest stand out. */
export class SearchLayer extends Layer {
  /** Take the cells in order; of `total` expansions the server may have sent only the first. */
  constructor(map, order, isKnown, total) {
    super(map.width, map.height);
    const size = map.width * map.height;
    const seen = new Uint8Array(size);
    this.order = order.filter(
      (index) => index >= 0 && index < size && !seen[index] && (seen[index] = 1),
    );
    this.isKnown = isKnown;
    this.total = order.length < total && order.length >= MAX_ORDER ? total : this.order.length;
    this.newest = Math.max(LEAST_NEWEST, Math.round(NEWEST_PART * this.order.length));
    this.count = 0;
    this.palette = null;
  }

  /** Show the first part (0 to 1) of the expansions; an unknown order is shown at once. */
  show(part, palette) {
    const target = this.isKnown
      ? Math.min(this.order.length, Math.round(part * this.total))
      : this.order.length;
    const isNew = palette !== this.palette;
    if (target === this.count && !isNew) return;
    const first = isNew ? 0 : Math.max(0, Math.min(this.count, target) - this.newest);
    const last = isNew ? this.order.length : Math.max(this.count, target);
    const hot = target < this.order.length ? target - this.newest : target;
    const [old, newest] = [palette.expanded, palette.newest].map((colour) => pixelOf(rgb(colour)));
    for (let i = first; i < last; i += 1)
      this.put(this.order[i], i >= target ? 0 : i >= hot ? newest : old);
    this.count = target;
    this.palette = palette;
    this.finish();
  }
}
