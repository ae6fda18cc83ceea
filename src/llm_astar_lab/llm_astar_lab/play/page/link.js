// The view as the fragment of the page's address, and back. A fragment is untrusted text.

import { FREE, MAX_EDITED, WALL } from './edits.js';
import { featuresOf } from './shapes.js';

const MAX_FRAGMENT = 60_000;
// What a link that would be too long leaves out.
const LARGE = ['walls', 'freed', 'costs', 'drawn', 'reply', 'instruction', 'why'];
const MAX_VIA = 100;
const DEFAULTS = {
  method: 'guided',
  source: 'none',
  heuristic: 'euclidean',
  weight: 2,
  max_suboptimality: 1.1,
  any_angle: false,
  alternatives: 0,
  why: '',
  reply: '',
  instruction: '',
  // Null: as fits the map.
  robot_radius: null,
  corner_cutting: null,
};
const NUMBERS = ['weight', 'max_suboptimality', 'robot_radius', 'alternatives'];
const TEXTS = ['method', 'source', 'heuristic', 'reply', 'instruction', 'why'];
const SWITCHES = ['any_angle', 'corner_cutting'];

/** Return the settings that a page begins with. */
export const defaultSettings = () => ({ ...DEFAULTS });

/** Return sorted cell indices as runs: gap and length in base 36, joined by dots. */
function encodeRuns(indices) {
  const runs = [];
  let end = 0;
  for (let i = 0; i < indices.length;) {
    let j = i + 1;
    while (j < indices.length && indices[j] === indices[j - 1] + 1) j += 1;
    runs.push((indices[i] - end).toString(36), (j - i).toString(36));
    end = indices[j - 1] + 1;
    i = j;
  }
  return runs.join('.');
}

/** Return the cell indices of runs that are below `size`, at most `limit` of them. */
function decodeRuns(encoded, size, limit) {
  const indices = [];
  const numbers = encoded
    .slice(0, MAX_FRAGMENT)
    .split('.')
    .map((item) => parseInt(item, 36));
  let at = 0;
  for (let i = 0; i + 1 < numbers.length; i += 2) {
    if (!(numbers[i] >= 0 && numbers[i + 1] > 0)) break;
    at += numbers[i];
    for (let n = numbers[i + 1]; n > 0 && at < size && indices.length < limit; n -= 1)
      indices.push(at++);
  }
  return indices;
}

/** Put what a view has drawn into the edits of its map. */
export function applyDrawn(view, edits) {
  const put = (runs, occupancy) => {
    const size = edits.map.cells.length;
    for (const index of decodeRuns(runs, size, MAX_EDITED - edits.cells.size))
      edits.cells.set(index, occupancy);
  };
  put(view.walls ?? '', WALL);
  put(view.freed ?? '', FREE);
  for (const part of (view.costs ?? '').split('~').slice(0, WALL)) {
    const [, cost, runs] = /^(\d{1,2})\.(.*)$/.exec(part) ?? [];
    if (Number(cost) > 0) put(runs, Number(cost));
  }
  try {
    edits.features = featuresOf(JSON.parse(view.drawn || '[]'));
  } catch {
    edits.features = [];
  }
}

/** Return the fragment for a view, and whether all of it fits. */
export function toFragment(view) {
  const query = new URLSearchParams();
  query.set('map', view.map);
  query.set('start', view.start.join(','));
  query.set('goal', view.goal.join(','));
  for (const [name, value] of Object.entries(view.settings)) {
    if (value === DEFAULTS[name] || value === null) continue;
    query.set(name, typeof value === 'boolean' ? String(Number(value)) : String(value));
  }
  if (view.via.length) query.set('via', view.via.map((cell) => cell.join(',')).join(';'));
  for (const occupancy of view.edits.levels()) {
    const name = { [FREE]: 'freed', [WALL]: 'walls' }[occupancy] ?? 'costs';
    const runs = encodeRuns(view.edits.indices(occupancy));
    const before = query.has(name) ? `${query.get(name)}~` : '';
    query.set(name, name === 'costs' ? `${before}${occupancy}.${runs}` : runs);
  }
  if (view.edits.features.length) query.set('drawn', JSON.stringify(view.edits.features));
  const fits = query.toString().length <= MAX_FRAGMENT;
  if (!fits) for (const name of LARGE) query.delete(name);
  return { fragment: query.toString().replaceAll('%2C', ',').replaceAll('%3B', ';'), fits };
}

/** Return the view of a fragment, null where it names no map; what cannot be read is left out. */
export function fromFragment(fragment) {
  const query = new URLSearchParams(fragment.replace(/^#/, '').slice(0, MAX_FRAGMENT));
  if (!query.get('map')) return null;
  const settings = defaultSettings();
  for (const name of TEXTS) settings[name] = query.get(name) ?? settings[name];
  for (const name of NUMBERS) {
    const value = query.has(name) ? Number(query.get(name)) : NaN;
    if (Number.isFinite(value)) settings[name] = value;
  }
  for (const name of SWITCHES) if (query.has(name)) settings[name] = query.get(name) === '1';
  const via = (query.get('via') ?? '').split(';').slice(0, MAX_VIA).map(cellOf).filter(Boolean);
  return {
    map: query.get('map'),
    start: cellOf(query.get('start')),
    goal: cellOf(query.get('goal')),
    settings,
    via,
    walls: query.get('walls') ?? '',
    freed: query.get('freed') ?? '',
    costs: query.get('costs') ?? '',
    drawn: query.get('drawn') ?? '',
  };
}

function cellOf(value) {
  const match = /^(\d{1,6}),(\d{1,6})$/.exec(value ?? '');
  return match ? [Number(match[1]), Number(match[2])] : null;
}
