// Axes, grid lines and the scale bar around and on a panel.

import { drawLabel } from './markers.js';

const LEAST_PIXELS = 58;

/** Return a step of 1, 2 or 5 times a power of ten that is at least `least`. */
function niceStep(least) {
  const power = 10 ** Math.floor(Math.log10(least));
  return [1, 2, 5, 10].map((factor) => factor * power).find((step) => step >= least * 0.999);
}

/** Return the numbers on an axis with their pixels. */
function ticks(map, axis, view, box) {
  const [from, to] =
    axis === 0 ? [box.left, box.left + box.width] : [box.top + box.height, box.top];
  const cellAt = (pixel) => view.toCell(axis === 0 ? [pixel, 0] : [0, pixel])[axis];
  const unit = map.isMetric ? map.resolution : 1;
  const step = Math.max(niceStep((LEAST_PIXELS / view.scale) * unit), map.isMetric ? 0 : 1);
  const [low, high] = [cellAt(from), cellAt(to)].map((cell) => map.axisValue(axis, cell));
  const zero = map.axisValue(axis, 0);
  const found = [];
  for (
    let value = Math.ceil(low / step) * step;
    value <= high && found.length < 60;
    value += step
  ) {
    const cell = (value - zero) / unit;
    const decimals = Math.max(0, Math.min(3, -Math.floor(Math.log10(step) + 1e-9)));
    found.push({
      pixel: view.toPixel([cell, cell])[axis],
      label: value.toFixed(decimals).replace(/^-0(\.0*)?$/, '0'),
    });
  }
  return found;
}

/** Draw ticks, numbers and names left of and below a box. */
export function drawAxes(context, map, view, box, palette) {
  const bottom = box.top + box.height;
  context.strokeStyle = palette.axis;
  context.fillStyle = palette.axis;
  context.font = '11.5px system-ui, sans-serif';
  context.lineWidth = 1;
  context.textBaseline = 'top';
  context.textAlign = 'center';
  for (const { pixel, label } of ticks(map, 0, view, box)) {
    line(context, pixel, bottom, pixel, bottom + 4);
    context.fillText(label, pixel, bottom + 7);
  }
  context.textBaseline = 'middle';
  context.textAlign = 'right';
  for (const { pixel, label } of ticks(map, 1, view, box)) {
    line(context, box.left - 4, pixel, box.left, pixel);
    context.fillText(label, box.left - 7, pixel);
  }
  drawNames(context, map, box);
}

function drawNames(context, map, box) {
  context.textAlign = 'left';
  context.textBaseline = 'bottom';
  context.fillText(map.axisName(0), box.left, box.top + box.height + 38);
  context.save();
  context.translate(Math.max(0, box.left - 46), box.top + box.height / 2);
  context.rotate(-Math.PI / 2);
  context.textAlign = 'center';
  context.textBaseline = 'top';
  context.fillText(map.axisName(1), 0, 1);
  context.restore();
}

/** Draw lines between cells that are wide enough. */
export function drawGrid(context, map, view, palette) {
  if (view.scale < 9) return;
  const [left, bottom] = view.toPixel([-0.5, -0.5]);
  const [right, top] = view.toPixel([map.width - 0.5, map.height - 0.5]);
  context.strokeStyle = palette.grid;
  context.lineWidth = 1;
  for (let x = 1; x < map.width; x += 1)
    line(context, left + x * view.scale, bottom, left + x * view.scale, top);
  for (let y = 1; y < map.height; y += 1)
    line(context, left, bottom - y * view.scale, right, bottom - y * view.scale);
}

/** Draw how long a length on the map is, in metres. */
export function drawScaleBar(context, map, view, box, palette) {
  if (!map.isMetric) return;
  const metres = niceStep((70 / view.scale) * map.resolution);
  const length = (metres / map.resolution) * view.scale;
  const y = box.top + box.height - 14;
  const x = box.left + box.width - 14;
  for (const [width, colour] of [
    [6, palette.halo],
    [2.5, palette.place],
  ]) {
    context.lineWidth = width;
    context.strokeStyle = colour;
    context.beginPath();
    context.moveTo(x - length, y - 5);
    context.lineTo(x - length, y);
    context.lineTo(x, y);
    context.lineTo(x, y - 5);
    context.stroke();
  }
  drawLabel(context, `${metres} m`, [x - length / 2, y - 13], palette, { size: 11.5 });
}

function line(context, x0, y0, x1, y1) {
  context.beginPath();
  context.moveTo(x0, y0);
  context.lineTo(x1, y1);
  context.stroke();
}
