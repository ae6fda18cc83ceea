// One map with one plan on a canvas.

import { drawAxes, drawGrid, drawScaleBar } from './axes.js';
import { int32s, number, objects, points, text } from './codec.js';
import { SearchLayer } from './layers.js';
import { drawAreas, drawLines, drawRules, drawShapes } from './areas.js';
import { drawLabel, drawMarker, labelWidth } from './markers.js';
import { statusShape, wayColour } from './theme.js';

const MARGIN = { left: 46, top: 8, right: 8, bottom: 40 };
// Pixels of width below which names are smaller, and within their places.
const SMALL = 420;
const MAX_BOXES = 600;
const MAX_WAYPOINTS = 500;
// Where a way's number may stand: half its width beside, pixels above or below.
const BESIDE = [
  [0, -18],
  [0, 18],
  [1, 0],
  [-1, 0],
  [1, -18],
  [-1, -18],
];
// Causes, and ways to choose from.
const MAX_REASONS = 50;
// How much of the expanded cells' colour is left below an instruction's regions.
const FADED = 0.4;
const NO_MARGIN = { left: 0, top: 0, right: 0, bottom: 0 };

/** Return how wide and high a polygon is, in sum. */
const extent = (polygon) =>
  [0, 1]
    .map((axis) => polygon.map((point) => point[axis]))
    .reduce((sum, values) => sum + Math.max(...values) - Math.min(...values), 0);

export class Panel {
  /** Take a figure element, the shared viewport, and whether it has axes. */
  constructor(figure, viewport, hasAxes) {
    this.figure = figure;
    this.canvas = figure.querySelector('canvas');
    this.context = this.canvas.getContext('2d');
    this.viewport = viewport;
    this.hasAxes = hasAxes;
    this.margin = hasAxes ? MARGIN : NO_MARGIN;
    this.map = null;
    this.plan = null;
    // What is drawn here, as `shapeOf` returns it, and an outline that is not yet closed.
    this.shapes = [];
    this.draft = [];
    // Rules of the road, and the other path of an answer, as the server sends them.
    this.rules = [];
    this.other = [];
  }

  /** Take a map and its picture, which the panels share. */
  setMap(map, base) {
    this.map = map;
    this.base = base;
    this.setPlan(null);
  }

  setPlan(plan) {
    this.plan = plan;
    this.path = points(plan?.any_angle ?? plan?.path);
    const listed = (items) => objects(items, MAX_REASONS);
    this.causes = listed(plan?.causes);
    this.ways = listed(plan?.ways).map((way) => ({ ...way, path: points(way.path) }));
    const order = int32s(plan?.expanded?.order);
    const total = Math.max(order.length, number(plan?.figures?.expansions) ?? 0);
    this.search = plan
      ? new SearchLayer(this.map, order, plan.order_is_known !== false, total)
      : null;
  }

  /** Fit the canvas to the width of its figure and to a height in pixels. */
  resize(maxHeight) {
    const { left, right, top, bottom } = this.margin;
    const width = Math.max(60, this.canvas.parentElement.clientWidth);
    const inner = ((width - left - right) * this.map.height) / this.map.width;
    const height = Math.round(Math.max(90, Math.min(inner + top + bottom, maxHeight)));
    const ratio = Math.min(3, devicePixelRatio || 1);
    this.canvas.style.height = `${height}px`;
    this.canvas.width = Math.round(width * ratio);
    this.canvas.height = Math.round(height * ratio);
    this.ratio = ratio;
    const [room, tall] = [width - left - right, height - top - bottom];
    // As wide as the map where the height is what limits it.
    const wide = Math.min(room, (tall * this.map.width) / this.map.height);
    this.box = { left: left + (room - wide) / 2, top, width: wide, height: tall };
  }

  get view() {
    return this.viewport.fit(this.map, this.box);
  }

  /** Draw what was planned for the ends, up to a part (0 to 1) of this plan's expansions. */
  draw(ends, part, palette) {
    const { context, view, box } = this;
    context.setTransform(this.ratio, 0, 0, this.ratio, 0, 0);
    context.clearRect(0, 0, this.canvas.width, this.canvas.height);
    context.save();
    context.beginPath();
    context.rect(box.left, box.top, box.width, box.height);
    context.clip();
    this.drawLayer(this.base, view);
    if (this.search) {
      this.search.show(part, palette);
      // What is asked for stands out once the search has ended.
      context.globalAlpha = part >= 1 && this.plan.regions ? FADED : 1;
      this.drawLayer(this.search, view);
      context.globalAlpha = 1;
    }
    drawGrid(context, this.map, view, palette);
    if (this.hasAxes) {
      this.drawPlaces(view, palette);
      drawAreas(context, this.plan?.regions?.areas, view, palette);
      drawShapes(context, this.shapes, this.draft, view, palette);
      drawRules(context, this.rules, view, palette);
    }
    if (part >= 1 && this.hasAxes) this.drawWays(view, palette);
    if (part >= 1) this.drawPath(ends, view, palette);
    if (this.hasAxes) this.drawCauses(view, palette);
    if (this.hasAxes) this.drawNames(ends, view, palette);
    if (this.hasAxes) drawScaleBar(context, this.map, view, box, palette);
    context.restore();
    if (this.hasAxes) drawAxes(context, this.map, view, box, palette);
    this.drawPoints(ends, view, palette);
  }

  drawLayer(layer, view) {
    const [left, top] = view.toPixel([-0.5, this.map.height - 0.5]);
    this.context.imageSmoothingEnabled = view.scale * this.ratio < 1;
    this.context.imageSmoothingQuality = 'high';
    this.context.drawImage(
      layer.canvas,
      left,
      top,
      this.map.width * view.scale,
      this.map.height * view.scale,
    );
  }

  drawPath(ends, view, palette) {
    const { context, path } = this;
    if (path.length < 2) return;
    context.lineJoin = 'round';
    context.lineCap = 'round';
    // A start or a goal that was moved.
    drawLines(
      context,
      [
        [ends.start, path[0]],
        [ends.goal, path.at(-1)],
      ].filter(([asked]) => asked),
      view,
      [4, palette.path, [1, 7]],
    );
    for (const [width, colour] of [
      [6, palette.outline],
      [3, palette.path],
    ]) {
      context.beginPath();
      for (const point of path) context.lineTo(...view.toPixel(point));
      context.lineWidth = this.hasAxes ? width : 0.75 * width;
      context.strokeStyle = colour;
      context.stroke();
    }
    const bad = this.plan?.regions?.violations ?? [];
    drawLines(context, bad, view, [5, palette.clause.NOT_KEPT, []]);
  }

  /** Draw the ways to choose from below the path, wider than it, and the other path of an answer. */
  drawWays(view, palette) {
    this.ways.forEach(({ path }, i) =>
      drawLines(this.context, [path], view, [11, `${wayColour(i, palette)}88`, []]),
    );
    if (this.other.length > 1)
      drawLines(this.context, [this.other], view, [3.5, palette.clause.UNSURE, [9, 6]]);
  }

  /** Mark what closes the way, with its name. */
  drawCauses(view, palette) {
    const { context } = this;
    const colour = palette.clause.NOT_KEPT;
    drawLines(
      context,
      this.causes.map((cause) => cause.points),
      view,
      [2.5, colour, [3, 5]],
    );
    for (const cause of this.causes) {
      for (const point of points(cause.points, 3))
        drawMarker(context, 'cross', view.toPixel(point), 8, colour, palette.edge, 1.2);
    }
  }

  drawPlaces(view, palette) {
    const { context } = this;
    context.strokeStyle = palette.place;
    context.globalAlpha = 0.55;
    context.lineWidth = 1;
    context.setLineDash([3, 4]);
    for (const { polygon } of this.map.places) {
      context.beginPath();
      for (const point of polygon) context.lineTo(...view.toPixel(point));
      context.closePath();
      context.stroke();
    }
    context.globalAlpha = 1;
    context.setLineDash([]);
  }

  /** Write the names of the places, each where neither another name nor a marker is. */
  drawNames(ends, view, palette) {
    const waypoints = points(
      this.plan?.waypoints?.map((item) => [item.x, item.y]),
      MAX_WAYPOINTS,
    );
    const marked = [ends.start, ends.goal, ...ends.via, ...waypoints].filter(Boolean);
    const taken = marked.map((cell) => {
      const [x, y] = view.toPixel(cell);
      return { x, y, half: 10 };
    });
    taken.push(...this.pathBoxes(view), this.scaleBarBox());
    if (this.hint) taken.push(this.hint);
    if (this.plan?.found) this.nameWays(view, palette, taken);
    for (const { name, points: at } of this.causes) {
      const [x, y] = view.toPixel(points(at).at(-1) ?? [0, 0]);
      const [label, half] = [text(name, 60), labelWidth(this.context, text(name, 60), 12) / 2];
      taken.push({ x, y, half: 9 }, { x, y: y - 18, half });
      drawLabel(this.context, label, [x, y - 18], palette, { colour: palette.clause.NOT_KEPT });
    }
    const drawn = this.shapes.map(({ name, rings }) => ({ name, polygon: rings[0] ?? [] }));
    drawn.push(...this.rules.map((rule) => ({ ...rule, polygon: points(rule.rings?.[0]) })));
    // The names of large places have more room to give way.
    const places = [...this.map.places].sort((a, b) => extent(a.polygon) - extent(b.polygon));
    for (const { name, polygon } of [...drawn, ...places]) {
      if (polygon.length) this.drawName(name, polygon, view, palette, taken);
    }
  }

  /** Write the number of each way where it is farthest from the others. */
  nameWays(view, palette, taken) {
    const some = ({ path }) => path.filter((_, i) => i % Math.ceil(path.length / 80) === 0);
    this.ways.forEach((way, i) => {
      const others = this.ways.filter((other) => other !== way).flatMap(some);
      const far = ([x, y]) =>
        Math.min(Infinity, ...others.map(([ox, oy]) => Math.hypot(ox - x, oy - y)));
      const cells = some(way);
      const distances = cells.map(far);
      const place = others.length ? distances.indexOf(Math.max(...distances)) : cells.length >> 1;
      const [left, top] = view.toPixel(cells[place] ?? [0, 0]);
      const label = `way ${i + 1}`;
      const half = labelWidth(this.context, label, 12) / 2;
      const spots = BESIDE.map(([dx, dy]) => [left + dx * (half + 10), top + dy]);
      const isFree = ([x, y]) =>
        taken.every((box) => Math.abs(box.x - x) >= box.half + half || Math.abs(box.y - y) >= (box.tall ?? 14));
      const [x, y] = spots.find(isFree) ?? spots[0];
      taken.push({ x, y, half });
      drawLabel(this.context, label, [x, y], palette, { colour: wayColour(i, palette) });
    });
  }

  /** Return where the path is, in boxes as names have them. */
  pathBoxes(view) {
    const boxes = [];
    for (let i = 1; i < this.path.length; i += 1) {
      const [from, to] = [this.path[i - 1], this.path[i]].map(view.toPixel);
      const steps = Math.max(1, Math.ceil(Math.hypot(to[0] - from[0], to[1] - from[1]) / 12));
      for (let n = 0; n < steps && boxes.length < MAX_BOXES; n += 1) {
        boxes.push({
          x: from[0] + ((to[0] - from[0]) * n) / steps,
          y: from[1] + ((to[1] - from[1]) * n) / steps,
          half: 2,
        });
      }
    }
    return boxes;
  }

  scaleBarBox() {
    const { left, top, width, height } = this.box;
    return { x: left + width - 60, y: top + height - 20, half: this.map.isMetric ? 55 : 0 };
  }

  /** Write a name in or near its place, if it is not much wider and another spot is free. */
  drawName(name, polygon, view, palette, taken) {
    const [xs, ys] = [0, 1].map((axis) => polygon.map((point) => view.toPixel(point)[axis]));
    const [width, height] = [xs, ys].map((values) => Math.max(...values) - Math.min(...values));
    const { size, most } =
      this.box.width < SMALL ? { size: 10.5, most: 1.05 } : { size: 12, most: 1.5 };
    const half = labelWidth(this.context, name, size) / 2;
    if (2 * half > most * width) return;
    const { left, width: room } = this.box;
    const x = Math.min(left + room - half, Math.max(left + half, Math.min(...xs) + width / 2));
    const middle = Math.min(...ys) + height / 2;
    const isFree = ([at, y]) =>
      taken.every(
        (box) => Math.abs(box.x - at) >= box.half + half || Math.abs(box.y - y) >= (box.tall ?? 17),
      );
    // In a wide place there is room to both sides of its middle.
    const aside = 0.3 * width > 2 * half ? [0.3 * width, -0.3 * width] : [];
    const down = [17, -17, 34, -34].filter(
      (shift) => Math.abs(shift) <= Math.max(17, height / 2 - 8),
    );
    const spots = [[0, 0], ...aside.map((shift) => [shift, 0]), ...down.map((shift) => [0, shift])];
    const spot = spots.map(([right, low]) => [x + right, middle + low]).find(isFree);
    if (!spot) return;
    taken.push({ x: spot[0], y: spot[1], half });
    drawLabel(this.context, name, spot, palette, { size, colour: palette.place });
  }

  /** Write a waypoint's number, unless it would be on another's. */
  drawNumber(label, [x, y], palette, numbered) {
    const isTaken = numbered.some((other) => Math.hypot(other[0] - x, other[1] - y) < 13);
    if (!this.hasAxes || isTaken) return;
    numbered.push([x, y]);
    drawLabel(this.context, label, [x + 12, y - 9], palette, { size: 11 });
  }

  drawPoints(ends, view, palette) {
    const { context } = this;
    const size = this.hasAxes ? 1 : 0.7;
    const waypoints = points(
      this.plan?.waypoints?.map((item) => [item.x, item.y, item]),
      MAX_WAYPOINTS,
    )
      .map((point) => ({ at: view.toPixel(point), ...point[2] }))
      .filter(({ at }) => this.shows(at));
    const mark = (shape, cell, radius, colour) => {
      const at = cell ? view.toPixel(cell) : null;
      if (at && this.shows(at))
        drawMarker(context, shape, at, radius * size, colour, palette.edge, 1.8);
    };
    for (const { at, status } of waypoints) {
      drawMarker(
        context,
        statusShape(status),
        at,
        7.5 * size,
        palette.waypoint[status] ?? '#7f7f7f',
        palette.edge,
        1.2,
      );
    }
    const numbered = [];
    for (const waypoint of waypoints)
      this.drawNumber(text(waypoint.number, 4), waypoint.at, palette, numbered);
    if (this.hasAxes) this.drawVisits(view, palette);
    for (const via of ends.via) mark('triangle', via, 8, palette.via);
    mark('square', ends.start, 9, palette.start);
    mark('diamond', ends.goal, 10, palette.goal);
  }

  /** Mark where the path visits what it is asked to. */
  drawVisits(view, palette) {
    const { context } = this;
    for (const point of points(this.plan?.regions?.visits, MAX_WAYPOINTS)) {
      const [x, y] = view.toPixel(point);
      context.beginPath();
      context.arc(x, y, 8, 0, 2 * Math.PI);
      context.fillStyle = palette.clause.KEPT;
      context.fill();
      drawLabel(context, '✓', [x, y + 0.5], { halo: palette.clause.KEPT }, { colour: '#ffffff' });
    }
  }

  /** Whether a pixel is on the map; a marker at its edge may stick out. */
  shows([x, y]) {
    const { left, top, width, height } = this.box;
    return x >= left && y >= top && x <= left + width && y <= top + height;
  }
}
