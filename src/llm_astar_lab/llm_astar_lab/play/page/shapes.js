// Places and zones as features of GeoJSON: what they look like on the map, and their files.

import { points, text } from './codec.js';

const MAX_FEATURES = 400;
export const CLOSED = 100;

/** Return the features of a list or a FeatureCollection; what is none is left out. */
export function featuresOf(value) {
  const features = Array.isArray(value) ? value : value?.features;
  if (!Array.isArray(features)) throw new Error('a GeoJSON FeatureCollection is expected');
  return features.filter((item) => item && typeof item === 'object').slice(0, MAX_FEATURES);
}

// Rules of the road, which are drawn as lines, in words.
export const KINDS = { one_way: 'one-way', keep_right: 'keep-right lane', preferred: 'preferred line' };

/** Return a feature with a line or the outline of a polygon in cells; zones have a cost or a kind. */
export function featureOf(map, polygon, properties) {
  const isLine = properties.kind !== undefined;
  const ring = (isLine ? polygon : [...polygon, polygon[0]]).map((point) =>
    map.toWorld(point).map((value) => Math.round(value * 1000) / 1000),
  );
  const geometry = isLine
    ? { type: 'LineString', coordinates: ring }
    : { type: 'Polygon', coordinates: [ring] };
  return { type: 'Feature', properties, geometry };
}

/** Return a feature as it is drawn: its name, its cost where it is a zone, its rings in cells. */
export function shapeOf(feature, map) {
  const { type, coordinates } = feature.geometry ?? {};
  const rings = { Point: [[coordinates]], Polygon: coordinates, MultiPolygon: flat(coordinates) };
  const list = Array.isArray(rings[type]) ? rings[type] : [];
  return {
    name: text(feature.properties?.name ?? feature.properties?.metadata?.name, 80),
    // Rules of the road may have no cost.
    cost: feature.properties?.cost ?? (isZone(feature) ? 0 : undefined),
    rings: list.slice(0, 100).map((ring) => points(ring, 2000).map((point) => map.toGrid(point))),
  };
}

const flat = (value) => (Array.isArray(value) ? value.flat(1) : []);

// The last are the edges of a nav2_route graph.
export const isZone = ({ properties = {} }) =>
  ['cost', 'kind', 'startid'].some((name) => properties?.[name] !== undefined);
export const isClosed = (shape) => Number(shape.cost) >= CLOSED;

/** Return a name such as 'zone 3' that no feature has. */
export function freeName(kind, features) {
  const names = new Set(features.map((feature) => feature.properties?.name));
  let number = 1;
  while (names.has(`${kind} ${number}`)) number += 1;
  return `${kind} ${number}`;
}

/** Return whether a point lies in a ring. */
export function isInside([x, y], ring) {
  let isIn = false;
  ring.forEach(([x1, y1], i) => {
    const [x0, y0] = ring.at(i - 1);
    if (y1 > y !== y0 > y && x < ((x0 - x1) * (y - y1)) / (y0 - y1) + x1) isIn = !isIn;
  });
  return isIn;
}

/** Save the places and the zones of a map, each kind in a file of its own, as the planner reads them. */
export function saveFeatures(map, features) {
  const drawn = features.filter((item) => !isZone(item));
  const names = new Set(drawn.map((item) => item.properties?.name));
  const kept = map.features.filter((item) => !names.has(item.properties?.name));
  if (drawn.length) download(`${map.name}.places.geojson`, [...kept, ...drawn]);
  const zones = features.filter(isZone);
  if (zones.length) download(`${map.name}.zones.geojson`, zones);
}

function download(name, features) {
  const content = JSON.stringify({ type: 'FeatureCollection', features }, null, 1);
  const link = document.createElement('a');
  link.href = URL.createObjectURL(new Blob([content], { type: 'application/geo+json' }));
  link.download = name;
  link.click();
  setTimeout(() => URL.revokeObjectURL(link.href), 10_000);
}
