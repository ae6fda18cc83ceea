// Areas on a map: what an instruction is about, and the places and zones that are drawn.

import { points } from './codec.js';
import { isClosed } from './shapes.js';

// Pixels between the lines of a hatch: where a path is not to be.
const HATCH = 9;
const MAX_AREAS = 200;

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
