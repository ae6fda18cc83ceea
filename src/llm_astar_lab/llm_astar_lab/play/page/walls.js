// Cells that are drawn as walls or erased, with undo.

export const MAX_EDITED = 80_000;
const MAX_STROKES = 200;

export class Walls {
  constructor(map) {
    this.map = map;
    // Cell index -> true (blocked) or false (freed), where that differs from the map.
    this.edits = new Map();
    this.done = [];
    this.undone = [];
    this.stroke = null;
  }

  isBlocked(index) {
    return this.edits.get(index) ?? this.map.isBlocked(index);
  }

  get isEdited() {
    return this.edits.size > 0;
  }

  /** Begin what one undo takes back. */
  begin() {
    this.stroke = new Map();
  }

  /** Draw or erase a square of `size` cells around a cell. Returns false once the limit is met. */
  paint([x, y], size, blocked) {
    const reach = (size - 1) / 2;
    for (let dy = -reach; dy <= reach; dy += 1) {
      for (let dx = -reach; dx <= reach; dx += 1) {
        const cell = [x + dx, y + dy];
        if (this.map.has(cell) && !this.put(cell[1] * this.map.width + cell[0], blocked))
          return false;
      }
    }
    return true;
  }

  put(index, blocked) {
    const before = this.edits.get(index);
    const isSame = blocked === this.map.isBlocked(index) && !this.map.isUnknown(index);
    const after = isSame ? undefined : blocked;
    if (before === after) return true;
    if (before === undefined && this.edits.size >= MAX_EDITED) return false;
    if (!this.stroke.has(index)) this.stroke.set(index, { before, after });
    else this.stroke.get(index).after = after;
    this.set(index, after);
    return true;
  }

  set(index, value) {
    if (value === undefined) this.edits.delete(index);
    else this.edits.set(index, value);
  }

  /** End the stroke. Returns whether it changed anything. */
  end() {
    const stroke = this.stroke;
    this.stroke = null;
    if (!stroke?.size) return false;
    this.done = [...this.done.slice(1 - MAX_STROKES), stroke];
    this.undone = [];
    return true;
  }

  undo() {
    const stroke = this.done.pop();
    if (!stroke) return;
    for (const [index, { before }] of stroke) this.set(index, before);
    this.undone.push(stroke);
  }

  redo() {
    const stroke = this.undone.pop();
    if (!stroke) return;
    for (const [index, { after }] of stroke) this.set(index, after);
    this.done.push(stroke);
  }

  /** Take all edits back, as one stroke. */
  clear() {
    this.begin();
    for (const index of [...this.edits.keys()]) {
      this.stroke.set(index, { before: this.edits.get(index), after: undefined });
      this.edits.delete(index);
    }
    this.end();
  }

  /** Return whether any cell is drawn (true) or erased (false). */
  has(blocked) {
    for (const value of this.edits.values()) if (value === blocked) return true;
    return false;
  }

  indices(blocked) {
    return [...this.edits]
      .filter(([, value]) => value === blocked)
      .map(([index]) => index)
      .sort((a, b) => a - b);
  }

  /** Return the edits as the server takes them. */
  toRequest() {
    const cells = (blocked) =>
      this.indices(blocked).map((index) => [
        index % this.map.width,
        Math.floor(index / this.map.width),
      ]);
    return { blocked: cells(true), freed: cells(false) };
  }
}
