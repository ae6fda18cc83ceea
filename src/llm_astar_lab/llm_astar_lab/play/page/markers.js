// Shapes of points on the map; each kind has its own, for readers who see few colours.

const TAU = 2 * Math.PI;

const polygon = (sides, turn = 0) =>
  Array.from({ length: sides }, (_, i) => {
    const angle = turn + (i * TAU) / sides;
    return [Math.cos(angle), Math.sin(angle)];
  });
const star = Array.from({ length: 10 }, (_, i) => {
  const angle = -TAU / 4 + (i * TAU) / 10;
  const radius = i % 2 ? 0.5 : 1.2;
  return [radius * Math.cos(angle), radius * Math.sin(angle)];
});
const plus = [
  [-0.35, -1],
  [0.35, -1],
  [0.35, -0.35],
  [1, -0.35],
  [1, 0.35],
  [0.35, 0.35],
  [0.35, 1],
  [-0.35, 1],
  [-0.35, 0.35],
  [-1, 0.35],
  [-1, -0.35],
  [-0.35, -0.35],
];
const turned = (shape, angle) =>
  shape.map(([x, y]) => [
    x * Math.cos(angle) - y * Math.sin(angle),
    x * Math.sin(angle) + y * Math.cos(angle),
  ]);

const SHAPES = {
  square: polygon(4, TAU / 8).map(([x, y]) => [1.15 * x, 1.15 * y]),
  diamond: polygon(4).map(([x, y]) => [1.15 * x, 1.15 * y]),
  triangle: polygon(3, -TAU / 4).map(([x, y]) => [1.15 * x, 1.15 * y]),
  down: polygon(3, TAU / 4).map(([x, y]) => [1.15 * x, 1.15 * y]),
  hexagon: polygon(6),
  star,
  cross: turned(plus, TAU / 8),
};

/** Draw a shape of a radius in pixels around a point. */
export function drawMarker(context, shape, [x, y], radius, fill, edge, width = 1.6) {
  context.beginPath();
  for (const [dx, dy] of SHAPES[shape]) context.lineTo(x + radius * dx, y + radius * dy);
  context.closePath();
  context.lineJoin = 'round';
  context.lineWidth = width;
  context.strokeStyle = edge;
  context.fillStyle = fill;
  context.fill();
  context.stroke();
}

/** Return how wide a label is, in pixels. */
export function labelWidth(context, label, size) {
  context.font = `600 ${size}px system-ui, sans-serif`;
  return context.measureText(label).width;
}

/** Draw a small text that stays readable on anything. */
export function drawLabel(context, label, [x, y], colours, options = {}) {
  const { size = 12, colour = colours.axis } = options;
  context.font = `600 ${size}px system-ui, sans-serif`;
  context.textAlign = 'center';
  context.textBaseline = 'middle';
  context.lineJoin = 'round';
  context.lineWidth = 3.5;
  context.strokeStyle = colours.halo;
  context.strokeText(label, x, y);
  context.fillStyle = colour;
  context.fillText(label, x, y);
}

/** Return a canvas of 20 x 20 pixels with a marker, for lists and legends. */
export function markerIcon(draw) {
  const ratio = Math.min(3, devicePixelRatio || 1);
  const canvas = document.createElement('canvas');
  canvas.width = 20 * ratio;
  canvas.height = 20 * ratio;
  canvas.setAttribute('aria-hidden', 'true');
  const context = canvas.getContext('2d');
  context.scale(ratio, ratio);
  draw(context);
  return canvas;
}
