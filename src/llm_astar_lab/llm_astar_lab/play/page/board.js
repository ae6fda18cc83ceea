// The map one can touch: handles for start, goal and via points, the brush, panning, the keyboard.

const $ = (id) => document.getElementById(id);
const ARROWS = { ArrowLeft: [-1, 0], ArrowRight: [1, 0], ArrowUp: [0, 1], ArrowDown: [0, -1] };
const FAR = 10;

export class Board {
  /**
   * Take the main panel and callbacks: `moved(name, cell, isDone)` for 'start', 'goal' or a via
   * point's index, `painted(indices, isDone)`, `added(cell)` and `removed(index)` for via points, `panned()`,
   * and `state()`, which returns {map, ends, walls}.
   */
  constructor(panel, callbacks) {
    this.panel = panel;
    this.canvas = panel.canvas;
    this.callbacks = callbacks;
    this.tool = 'move';
    // The cell of the brush when it is moved by keys.
    this.cursor = null;
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
    $('brush-row').hidden = !['wall', 'erase'].includes(tool);
    this.canvas.style.cursor = tool === 'move' ? 'default' : 'crosshair';
    for (const { button } of this.handles)
      button.style.pointerEvents = this.isPainting ? 'none' : '';
  }

  get isPainting() {
    return ['wall', 'erase'].includes(this.tool);
  }

  listen() {
    $('tools').addEventListener(
      'click',
      (event) => event.target.dataset.tool && this.setTool(event.target.dataset.tool),
    );
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
    const { map, walls } = this.callbacks.state();
    if (!cell || !map?.has(cell)) {
      $('readout').textContent = '';
      this.showBrush(null);
      return;
    }
    this.showBrush(cell);
    const index = cell[1] * map.width + cell[0];
    const blocked = walls ? walls.isBlocked(index) : map.isBlocked(index);
    const isUnknown = map.isUnknown(index) && walls?.edits.get(index) === undefined;
    $('readout').textContent =
      `${map.described(cell)}: ${isUnknown ? 'unknown' : blocked ? 'obstacle' : 'free'}`;
  }

  onDown(event) {
    const { map, ends } = this.callbacks.state();
    if (!map || event.button) return;
    const cell = this.cellOf(event);
    if (ends && this.isPainting) this.paint(event, cell);
    else if (ends && this.tool === 'via') this.callbacks.added(map.clamped(cell));
    else this.pan(event);
  }

  /** Follow the pointer on an element until it is let go. */
  follow(target, event, onMove, onEnd) {
    target.setPointerCapture(event.pointerId);
    const end = () => {
      target.removeEventListener('pointermove', onMove);
      target.removeEventListener('pointerup', end);
      target.removeEventListener('pointercancel', end);
      onEnd();
    };
    target.addEventListener('pointermove', onMove);
    target.addEventListener('pointerup', end);
    target.addEventListener('pointercancel', end);
  }

  paint(event, cell) {
    const { walls } = this.callbacks.state();
    let last = cell;
    walls.begin();
    walls.paint(cell, this.brush, this.tool === 'wall');
    this.callbacks.painted(walls.stroke.keys(), false);
    this.follow(
      this.canvas,
      event,
      (move) => {
        const next = this.cellOf(move);
        this.strokeTo(last, next, walls);
        last = next;
        this.callbacks.painted(walls.stroke.keys(), false);
      },
      () => this.callbacks.painted([], walls.end()),
    );
  }

  /** Paint every cell between two. */
  strokeTo(from, to, walls) {
    const steps = Math.max(Math.abs(to[0] - from[0]), Math.abs(to[1] - from[1]), 1);
    for (let i = 1; i <= steps; i += 1) {
      const cell = [0, 1].map((axis) =>
        Math.round(from[axis] + ((to[axis] - from[axis]) * i) / steps),
      );
      walls.paint(cell, this.brush, this.tool === 'wall');
    }
  }

  pan(event) {
    if (this.panel.viewport.zoom === 1) return;
    const { map } = this.callbacks.state();
    const held = this.positionOf(event);
    this.follow(
      this.canvas,
      event,
      (move) => {
        const now = this.positionOf(move);
        this.panel.viewport.pan(held[0] - now[0], held[1] - now[1], map);
        this.callbacks.panned();
      },
      () => {},
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
    const { walls } = this.callbacks.state();
    walls.begin();
    walls.paint(cell, this.brush, this.tool === 'wall');
    this.callbacks.painted([...walls.stroke.keys()], walls.end());
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
    const half = $('hint').offsetWidth / 2 + 2;
    const width = this.canvas.clientWidth;
    $('hint').style.left = `${Math.min(width - half, Math.max(half, x))}px`;
    $('hint').style.top = `${y}px`;
    $('hint').classList.toggle('below', y < 60);
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
