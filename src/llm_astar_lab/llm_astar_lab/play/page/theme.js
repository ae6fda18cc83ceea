// Colours of the map: the server's, those of every picture of the project, fitted to dark schemes.

const NAMES = {
  accepted: 'accepted',
  unreachable: 'unreachable',
  occupied: 'occupied',
  out_of_bounds: 'out of bounds',
};
// Should the server send none.
const FALLBACK = {
  free: '#ffffff',
  obstacle: '#262a33',
  unknown: '#e9ebef',
  inflated: '#a9aeb8',
  expanded: '#fcd588',
  path: '#0050b5',
  start: '#56b4e9',
  goal: '#e0218a',
  via: '#f0e442',
  avoided: '#b5533c',
  rule: '#6d4aa8',
  ways: ['#e07b00', '#8e44ad', '#00838f', '#8c6d46'],
  clause: { KEPT: '#009e73', NOT_KEPT: '#c8102e', AS_FAR_AS_POSSIBLE: '#b8860b', UNSURE: '#e08a00' },
  waypoint: {
    accepted: '#009e73',
    unreachable: '#8e44ad',
    occupied: '#d55e00',
    out_of_bounds: '#7f7f7f',
  },
};
const SHAPES = {
  accepted: 'star',
  unreachable: 'down',
  occupied: 'cross',
  out_of_bounds: 'hexagon',
};
const DARK = {
  free: '#232a35',
  obstacle: '#79849a',
  unknown: '#191e26',
  inflated: '#434d5e',
  expanded: '#94702f',
  newest: '#f5b947',
  path: '#79bbff',
  outline: '#0d1117',
  edge: '#0d1117',
  grid: 'rgb(255 255 255 / 5%)',
  wall: '#c7a6e8',
  freed: '#2f4a4a',
  avoided: '#ef8f78',
  rule: '#b79cf0',
  clause: { KEPT: '#3fc79a', NOT_KEPT: '#ff6b6b', AS_FAR_AS_POSSIBLE: '#e0b040', UNSURE: '#f5b947' },
  place: '#b4c7d8',
  halo: '#151a21',
  axis: '#a2abb9',
};
const LIGHT = {
  newest: '#f09a0a',
  outline: '#ffffff',
  edge: '#111111',
  grid: 'rgb(20 30 50 / 6%)',
  wall: '#5c3d82',
  freed: '#dff1ea',
  place: '#4d6d82',
  halo: '#ffffff',
  axis: '#5b6270',
};
const HEX = /^#[0-9a-f]{6}$/i;

/** Return the name of a waypoint's status in words. */
export const statusName = (status) => NAMES[status] ?? 'unknown';

/** Return the shape of a waypoint's marker. */
export const statusShape = (status) => SHAPES[status] ?? 'hexagon';

/** Return the colour of one of several ways, by its number from 0. */
export const wayColour = (number, { ways }) => ways[number % Object.keys(ways).length];

/** Return the colours for the present scheme; `sent` are the server's. */
export function palette(sent, isDark) {
  const checked = (own, given) =>
    Object.fromEntries(
      Object.entries(own).map(([name, colour]) => [
        name,
        typeof colour === 'object'
          ? checked(colour, given?.[name])
          : HEX.test(given?.[name])
            ? given[name]
            : colour,
      ]),
    );
  const colours = checked(FALLBACK, sent);
  return { ...colours, ...(isDark ? DARK : LIGHT) };
}

/** Return the red, green and blue of a colour. */
export function rgb(hex) {
  return [1, 3, 5].map((at) => parseInt(hex.slice(at, at + 2), 16));
}

/** Watch the scheme of the system; calls back with whether it is dark. */
export function watchScheme(callback) {
  const query = matchMedia('(prefers-color-scheme: dark)');
  query.addEventListener('change', () => callback(query.matches));
  return query.matches;
}
