// Areas on a map: what an instruction is about, and the places and zones that are drawn.

import { number, points } from './codec.js';
import { CLOSED, isClosed, KINDS } from './shapes.js';

// Pixels between the lines of a hatch: where a path is not to be.
const HATCH = 9;
const MAX_AREAS = 200;
const MAX_ARROWS = 1000;
// Pixels between the heads along an arrow, and a head that points to the right.
const ARROWS_APART = 70;
const HEAD = [
  [7, 0],
  [-5, -5.5],
  [-2.5, 0],
  [-5, 5.5],
];

/** Draw the areas of an instruction: hatched where they are to be avoided, else tinted. */
export function drawAreas(context, areas, view, palette) {
  for (const area of (Array.isArray(areas) ? areas : []).slice(0, MAX_AREAS)) {
    const rings = (area.rings ?? []).map((ring) => points(ring).map(view.toPixel));
    drawArea(context, rings, lookOf(area, palette));
  }
}

/** Draw the places and zones that were drawn, and an outline that is still open. */
export function drawShapes(context, shapes, draft, view, palette) {
  for (const shape of shapes) {
    const rings = shape.rings.map((ring) => ring.map(view.toPixel));
    const isZone = shape.cost !== undefined;
    drawArea(context, rings, isZone ? zoneLook(isClosed(shape), palette) : placeLook(palette));
  }
  if (draft.length)
    drawArea(context, [draft.map(view.toPixel)], { ...placeLook(palette), colour: palette.path });
}

/** Return how to draw an area in the legend. */
export function areaIcon(area, palette) {
  const look = area.zone === undefined ? lookOf(area, palette) : zoneLook(area.zone, palette);
  const ring = [
    [2, 4],
    [18, 4],
    [18, 16],
    [2, 16],
  ];
  return (context) => drawArea(context, [ring], { ...look, step: 5 });
}

/** Draw the rules of the road: where they hold, and arrows along the ways that they leave. */
export function drawRules(context, rules, view, palette) {
  for (const { kind, rings, arrows, width, cost } of rules) {
    const outlines = (Array.isArray(rings) ? rings : []).map((ring) => points(ring).map(view.toPixel));
    const look = kind in KINDS ? ruleLook(kind, palette) : zoneLook(cost >= CLOSED, palette);
    drawArea(context, outlines, look);
    const apart = kind === 'keep_right' ? (number(width) ?? 0) / 4 : 0;
    for (const arrow of (Array.isArray(arrows) ? arrows : []).slice(0, MAX_ARROWS)) {
      const [from, to] = points(arrow, 2);
      if (!to) continue;
      const [dx, dy] = [to[0] - from[0], to[1] - from[1]];
      const part = apart / (Math.hypot(dx, dy) || 1);
      const beside = (point, side) =>
        view.toPixel([point[0] + side * part * dy, point[1] - side * part * dx]);
      drawArrow(context, beside(from, 1), beside(to, 1), palette.rule);
      if (apart) drawArrow(context, beside(to, -1), beside(from, -1), palette.rule);
    }
  }
}

/** Draw a line between pixels with heads along it. */
function drawArrow(context, from, to, colour) {
  const [dx, dy] = [to[0] - from[0], to[1] - from[1]];
  const length = Math.hypot(dx, dy);
  const count = Math.max(1, Math.floor(length / ARROWS_APART));
  context.save();
  context.strokeStyle = colour;
  context.fillStyle = colour;
  context.lineWidth = 1.6;
  context.beginPath();
  context.moveTo(...from);
  context.lineTo(...to);
  context.stroke();
  for (let i = 0; i < count; i += 1) {
    context.save();
    const part = (i + 0.5) / count;
    context.translate(from[0] + part * dx, from[1] + part * dy);
    context.rotate(Math.atan2(dy, dx));
    context.beginPath();
    for (const point of HEAD) context.lineTo(...point);
    context.fill();
    context.restore();
  }
  context.restore();
}

/** Return how a rule looks in the legend. */
export function ruleIcon(kind, palette) {
  const ring = [
    [2, 3],
    [18, 3],
    [18, 17],
    [2, 17],
  ];
  return (context) => {
    drawArea(context, [ring], ruleLook(kind, palette));
    if (kind !== 'preferred') drawArrow(context, [3, 10], [17, 10], palette.rule);
  };
}

const ruleLook = (kind, palette) => ({
  colour: kind === 'preferred' ? palette.clause.KEPT : palette.rule,
  tint: 0.13,
});

/** Draw lines between points in cells. */
export function drawLines(context, lines, view, [width, colour, dash]) {
  context.save();
  context.lineWidth = width;
  context.strokeStyle = colour;
  context.setLineDash(dash);
  for (const line of lines) {
    context.beginPath();
    for (const point of points(line)) context.lineTo(...view.toPixel(point));
    context.stroke();
  }
  context.restore();
}

function lookOf(area, palette) {
  const isKept = area.status === 'KEPT';
  const colour = palette.clause[area.status] ?? palette.clause.NOT_KEPT;
  return area.is_avoided
    ? { colour: isKept ? palette.avoided : colour, tint: 0.13, isHatched: true }
    : { colour, tint: isKept ? 0.2 : 0.1 };
}

const zoneLook = (isShut, palette) => ({
  colour: isShut ? palette.clause.NOT_KEPT : palette.clause.AS_FAR_AS_POSSIBLE,
  tint: isShut ? 0.3 : 0.2,
  isHatched: isShut,
});
const placeLook = (palette) => ({ colour: palette.place, tint: 0.16 });

/** Draw an area by its rings in pixels; rings within others are holes. */
function drawArea(context, rings, { colour, tint, isHatched, step = HATCH }) {
  context.save();
  context.beginPath();
  for (const ring of rings) {
    ring.forEach((point, i) => (i ? context.lineTo(...point) : context.moveTo(...point)));
    context.closePath();
  }
  context.fillStyle = colour;
  context.strokeStyle = colour;
  context.lineWidth = 1.6;
  context.globalAlpha = tint;
  context.fill('evenodd');
  context.globalAlpha = 0.9;
  context.stroke();
  if (isHatched) hatch(context, rings.flat(), step);
  context.restore();
}

/** Draw diagonal lines within the current path. */
function hatch(context, corners, step) {
  const [xs, ys] = [0, 1].map((axis) => corners.map((corner) => corner[axis]));
  const [left, right] = [Math.min(...xs), Math.max(...xs)];
  const [top, bottom] = [Math.min(...ys), Math.max(...ys)];
  const height = bottom - top;
  context.clip('evenodd');
  context.beginPath();
  context.lineWidth = 1;
  context.globalAlpha = 0.6;
  for (let x = left - height; x < right; x += step) {
    context.moveTo(x, bottom);
    context.lineTo(x + height, top);
  }
  context.stroke();
}
