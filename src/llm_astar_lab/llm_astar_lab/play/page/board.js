// The map one can touch: handles for start, goal and via points, the brush, outlines, panning, the
// keyboard.

import { text } from './codec.js';
import { FREE, WALL } from './edits.js';
import { UNKNOWN } from './gridmap.js';
import { isClosed, KINDS } from './shapes.js';

const $ = (id) => document.getElementById(id);
const ARROWS = { ArrowLeft: [-1, 0], ArrowRight: [1, 0], ArrowUp: [0, 1], ArrowDown: [0, -1] };
const FAR = 10;
// Pixels around the first corner that close an outline, and that a press may move by.
const NEAR = 10;
const STILL = 5;

const box = ([x0, y0], [x1, y1]) => [
  [x0, y0],
  [x1, y0],
  [x1, y1],
  [x0, y1],
];

export class Board {
  /**
   * Take the main panel and callbacks: `moved(name, cell, isDone)` for 'start', 'goal' or a via
   * point's index, `painted(indices, isDone)`, `added(cell)` and `removed(index)` for via points,
   * `drafted(polygon)` and `outlined(polygon, tool)` for places and zones, `pressed(point)` in cells
   * for a press on the map, `panned()`, and `state()`, which returns {map, ends, edits, shapes}.
   */
  constructor(panel, callbacks) {
    this.panel = panel;
    this.canvas = panel.canvas;
    this.callbacks = callbacks;
    this.tool = 'move';
    // The cell of the brush when it is moved by keys.
    this.cursor = null;
    // Of an area that is being outlined.
    this.corners = [];
    this.handles = [];
    this.listen();
  }

  get brush() {
    return Number($('brush').value);
  }

  setTool(tool) {
    this.tool = tool;
    this.showBrush(null);
    for (const button of $('tools').children)
      button.setAttribute('aria-pressed', String(button.dataset.tool === tool));
    for (const part of document.querySelectorAll('[data-tools]'))
      part.hidden = !part.dataset.tools.split(' ').includes(tool);
    this.draft([]);
    this.showZone();
    this.canvas.style.cursor = tool === 'move' ? 'default' : 'crosshair';
    for (const { button } of this.handles)
      button.style.pointerEvents = this.isPainting || this.isOutlining ? 'none' : '';
  }

  /** Whether a rule of the road is being drawn, which is a line. */
  get isLine() {
    return this.tool === 'zone' && $('zone-cost').value in KINDS;
  }

  /** Say how to draw a place or a zone, and ask for the width of a line. */
  showZone() {
    $('zone-width-row').hidden = !this.isLine;
    $('zone-note').textContent = this.isLine
      ? 'Drag a line the way it leads, or click its points; a click on the last ends it.'
      : 'Drag a rectangle, or click corners; a click on the first closes it.';
  }

  get isPainting() {
    return ['wall', 'cost', 'erase'].includes(this.tool);
  }

  get isOutlining() {
    return ['place', 'zone'].includes(this.tool);
  }

  /** The occupancy that the brush gives to cells. */
  get paint() {
    return { wall: WALL, cost: Number($('level').value), erase: FREE }[this.tool];
  }

  listen() {
    $('tools').addEventListener(
      'click',
      (event) => event.target.dataset.tool && this.setTool(event.target.dataset.tool),
    );
    $('zone-cost').addEventListener('change', () => {
      this.draft([]);
      this.showZone();
    });
    this.canvas.addEventListener('pointerdown', (event) => this.onDown(event));
    this.canvas.addEventListener('pointermove', (event) => this.readOut(this.cellOf(event)));
    this.canvas.addEventListener('pointerleave', () => this.readOut(null));
    this.canvas.addEventListener('keydown', (event) => this.onKey(event));
    this.canvas.addEventListener('wheel', (event) => this.onWheel(event), { passive: false });
    // A finger scrolls the page, unless it paints or the map is zoomed in.
    this.canvas.addEventListener(
      'touchstart',
      (event) => {
        if (this.tool !== 'move' || this.panel.viewport.zoom > 1) event.preventDefault();
      },
      { passive: false },
    );
  }

  positionOf(event) {
    const box = this.canvas.getBoundingClientRect();
    return this.panel.view.toCell([event.clientX - box.left, event.clientY - box.top]);
  }

  cellOf(event) {
    return this.positionOf(event).map(Math.round);
  }

  readOut(cell) {
    const { map } = this.callbacks.state();
    const isOn = Boolean(cell && map?.has(cell));
    this.showBrush(isOn ? cell : null);
    $('readout').textContent = isOn ? `${map.described(cell)}: ${this.valuesAt(cell)}` : '';
  }

  /** Return in words what a cell is, and what lies there. */
  valuesAt(cell) {
    const { map, edits, shapes, lethal } = this.callbacks.state();
    const index = cell[1] * map.width + cell[0];
    const value = edits ? edits.valueOf(index) : map.cells[index];
    const isBlocked = edits ? edits.isBlocked(index) : map.isBlocked(index);
    const around = shapes(cell);
    const isShut = around.some(isClosed);
    const word =
      value === UNKNOWN ? 'unknown' : isBlocked ? 'obstacle' : isShut ? 'closed' : 'free';
    const here = around.map(({ name, cost, kind }) => {
      if (kind in KINDS) return `${text(name, 80)} (${KINDS[kind]})`;
      return cost === undefined || isShut ? name : `${name} (cost ${cost} of 100)`;
    });
    return [
      word,
      word === 'free' && value > 0 && `cost ${value} of 100`,
      word === 'free' && lethal?.[index] && 'too close for the robot',
      ...here.slice(0, 4),
    ]
      .filter(Boolean)
      .join(', ');
  }

  onDown(event) {
    const { map, ends } = this.callbacks.state();
    if (!map || event.button) return;
    const cell = this.cellOf(event);
    this.readOut(cell);
    if (ends && this.isPainting) this.paintFrom(event, cell);
    else if (ends && this.isOutlining) this.outline(event);
    else if (ends && this.tool === 'via') this.callbacks.added(map.clamped(cell));
    else this.pan(event);
  }

  /** Follow the pointer on an element until it is let go, or taken away, as by scrolling. */
  follow(target, event, onMove, onEnd) {
    target.setPointerCapture(event.pointerId);
    const end = ({ type }) => {
      target.removeEventListener('pointermove', onMove);
      target.removeEventListener('pointerup', end);
      target.removeEventListener('pointercancel', end);
      onEnd(type === 'pointercancel');
    };
    target.addEventListener('pointermove', onMove);
    target.addEventListener('pointerup', end);
    target.addEventListener('pointercancel', end);
  }

  paintFrom(event, cell) {
    const { edits } = this.callbacks.state();
    let last = cell;
    edits.begin();
    edits.paint(cell, this.brush, this.paint);
    this.callbacks.painted(edits.stroke.keys(), false);
    this.follow(
      this.canvas,
      event,
      (move) => {
        const next = this.cellOf(move);
        this.strokeTo(last, next, edits);
        last = next;
        this.callbacks.painted(edits.stroke.keys(), false);
      },
      () => this.callbacks.painted([], edits.end()),
    );
  }

  /** Paint every cell between two. */
  strokeTo(from, to, edits) {
    const steps = Math.max(Math.abs(to[0] - from[0]), Math.abs(to[1] - from[1]), 1);
    for (let i = 1; i <= steps; i += 1) {
      const cell = [0, 1].map((axis) =>
        Math.round(from[axis] + ((to[axis] - from[axis]) * i) / steps),
      );
      edits.paint(cell, this.brush, this.paint);
    }
  }

  /**
   * Outline an area: drag a rectangle, or press its corners; on the first again closes it. Of a
   * rule of the road drag a line, or press its points; on the last again ends it.
   */
  outline(event) {
    const { isLine } = this;
    const edge = (pointer) =>
      isLine
        ? this.cellOf(pointer)
        : this.positionOf(pointer).map((value) => Math.round(value + 0.5) - 0.5);
    const whole = (from, to) => (isLine ? [from, to] : box(from, to));
    const from = edge(event);
    let to = from;
    this.follow(
      this.canvas,
      event,
      (move) => {
        to = edge(move);
        this.callbacks.drafted(this.corners.length ? [...this.corners, to] : whole(from, to));
      },
      () => {
        const moved = [0, 1].filter((axis) => from[axis] !== to[axis]).length;
        if (!this.corners.length && moved >= (isLine ? 1 : 2)) this.close(whole(from, to));
        else this.addCorner(to);
      },
    );
  }

  addCorner(point) {
    const [x, y] = this.corners.at(this.isLine ? -1 : 0) ?? [];
    const reach = NEAR / this.panel.view.scale;
    if (Math.hypot(point[0] - x, point[1] - y) <= reach) this.close(this.corners);
    else this.draft([...this.corners, point]);
  }

  draft(corners) {
    this.corners = corners;
    this.callbacks.drafted(corners);
  }

  close(corners) {
    this.draft([]);
    if (corners.length > (this.isLine ? 1 : 2)) this.callbacks.outlined(corners, this.tool);
  }

  /** Move the map with the pointer; one that stays has pressed it. */
  pan(event) {
    const { map } = this.callbacks.state();
    const held = this.positionOf(event);
    let isStill = true;
    this.follow(
      this.canvas,
      event,
      (move) => {
        const far = Math.hypot(move.clientX - event.clientX, move.clientY - event.clientY);
        isStill = isStill && far < STILL;
        if (isStill || this.panel.viewport.zoom === 1) return;
        const now = this.positionOf(move);
        this.panel.viewport.pan(held[0] - now[0], held[1] - now[1], map);
        this.callbacks.panned();
      },
      (isCancelled) => isStill && !isCancelled && this.callbacks.pressed(held),
    );
  }

  onWheel(event) {
    const { map } = this.callbacks.state();
    if (!map || !(event.ctrlKey || event.metaKey)) return;
    event.preventDefault();
    this.panel.viewport.zoomBy(Math.exp(-event.deltaY / 250), map, this.positionOf(event));
    this.callbacks.panned();
  }

  onKey(event) {
    const arrow = ARROWS[event.key];
    const { map, ends } = this.callbacks.state();
    const isDrawing = ends && this.tool !== 'move';
    if (!map || !(isDrawing || this.panel.viewport.zoom > 1)) return;
    if (event.key === 'Enter') this.close(this.corners);
    if (event.key === 'Escape') this.draft([]);
    if (!arrow && !(isDrawing && event.key === ' ')) return;
    event.preventDefault();
    if (!isDrawing) this.panByKey(arrow, map);
    else if (arrow) this.moveCursor(arrow, event.shiftKey ? FAR : 1, map);
    else this.useCursor(map.clamped(this.cursor ?? ends.start));
  }

  panByKey(arrow, map) {
    const step = Math.max(1, Math.round(map.width / (10 * this.panel.viewport.zoom)));
    this.panel.viewport.pan(arrow[0] * step, arrow[1] * step, map);
    this.callbacks.panned();
  }

  /** Move the brush by cells; it begins at the start. */
  moveCursor(arrow, step, map) {
    const [x, y] = this.cursor ?? this.callbacks.state().ends.start;
    this.cursor = map.clamped([x + step * arrow[0], y + step * arrow[1]]);
    this.readOut(this.cursor);
  }

  /** Paint under the brush, or put a via point there. */
  useCursor(cell) {
    if (this.tool === 'via') {
      this.callbacks.added(cell);
      return;
    }
    if (this.isOutlining) {
      this.addCorner(cell);
      return;
    }
    const { edits } = this.callbacks.state();
    edits.begin();
    edits.paint(cell, this.brush, this.paint);
    const indices = [...edits.stroke.keys()];
    this.callbacks.painted(indices, edits.end());
    this.readOut(cell);
  }

  /** Outline the cells under the brush. */
  showBrush(cell) {
    $('cursor').hidden = !cell || this.tool === 'move';
    if ($('cursor').hidden) return;
    const { view } = this.panel;
    const size = view.scale * (this.isPainting ? this.brush : 1);
    const [x, y] = view.toPixel(cell);
    Object.assign($('cursor').style, {
      left: `${x - size / 2}px`,
      top: `${y - size / 2}px`,
      width: `${size}px`,
      height: `${size}px`,
    });
  }

  /** Put a button on each of start, goal and via points. */
  placeHandles() {
    const { ends } = this.callbacks.state();
    const wanted = ends ? ['start', 'goal', ...ends.via.keys()] : [];
    while (this.handles.length > wanted.length) this.handles.pop().button.remove();
    wanted.forEach((name, i) => {
      if (!this.handles[i]) this.handles.push(this.makeHandle(name));
      this.placeHandle(this.handles[i], this.callbacks.state());
    });
  }

  placeHandle({ name, button }, { map, ends }) {
    const cell = typeof name === 'number' ? ends.via[name] : ends[name];
    const [x, y] = this.panel.view.toPixel(cell);
    const { left, top, width, height } = this.panel.box;
    button.style.left = `${x}px`;
    button.style.top = `${y}px`;
    button.hidden = x < left || y < top || x > left + width || y > top + height;
    const title =
      typeof name === 'number' ? `Via point ${name + 1}` : name === 'start' ? 'Start' : 'Goal';
    const extra = typeof name === 'number' ? ', Delete removes it' : '';
    button.setAttribute(
      'aria-label',
      `${title} at ${map.described(cell)}. Arrow keys move it${extra}.`,
    );
    if (name === 'goal') this.placeHint(x, y, !button.hidden);
  }

  /** Say once that the goal can be dragged. */
  showHint() {
    this.isHinting = true;
    this.placeHandles();
  }

  hideHint() {
    this.isHinting = false;
    $('hint').hidden = true;
  }

  placeHint(x, y, isShown) {
    $('hint').hidden = !(this.isHinting && isShown);
    const isBelow = y < 60;
    const half = $('hint').offsetWidth / 2 + 2;
    const width = this.canvas.clientWidth;
    $('hint').style.left = `${Math.min(width - half, Math.max(half, x))}px`;
    $('hint').style.top = `${y}px`;
    $('hint').classList.toggle('below', isBelow);
    const middle = isBelow ? y + 38 : y - 32;
    this.panel.hint = $('hint').hidden ? null : { x, y: middle, half, tall: 24 };
  }

  makeHandle(name) {
    const button = document.createElement('button');
    button.type = 'button';
    button.className = 'handle';
    button.dataset.handle = String(name);
    this.canvas.parentElement.append(button);
    button.addEventListener('pointerdown', (event) => this.drag(name, button, event));
    button.addEventListener('keydown', (event) => this.onHandleKey(name, event));
    return { name, button };
  }

  drag(name, button, event) {
    if (event.button) return;
    const { map } = this.callbacks.state();
    this.follow(
      button,
      event,
      (move) => {
        const cell = map.clamped(this.cellOf(move));
        this.readOut(cell);
        this.callbacks.moved(name, cell, false);
      },
      () => this.callbacks.moved(name, null, true),
    );
  }

  onHandleKey(name, event) {
    const { map, ends } = this.callbacks.state();
    if (typeof name === 'number' && ['Delete', 'Backspace'].includes(event.key))
      this.callbacks.removed(name);
    const arrow = ARROWS[event.key];
    if (!arrow) return;
    event.preventDefault();
    const step = event.shiftKey ? FAR : 1;
    const cell = typeof name === 'number' ? ends.via[name] : ends[name];
    const next = map.clamped([cell[0] + step * arrow[0], cell[1] + step * arrow[1]]);
    this.readOut(next);
    this.callbacks.moved(name, next, true);
  }
}
