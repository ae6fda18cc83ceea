// What is shown in words and numbers: verdict, table, waypoints, clauses, command, report.

import { number, points, shown, text } from './codec.js';
import { areaIcon, ruleIcon } from './areas.js';
import { FREE, WALL } from './edits.js';
import { MAX_ORDER } from './layers.js';
import { drawMarker, markerIcon } from './markers.js';
import { isClosed, KINDS } from './shapes.js';
import { statusName, statusShape, wayColour } from './theme.js';
import { verdictOf } from './verdict.js';

const $ = (id) => document.getElementById(id);
const CLAUSE_TONES = {
  kept: 'good',
  'kept as far as possible': 'warn',
  'not kept': 'bad',
  impossible: 'bad',
  unsure: 'warn',
};
const NOT_UNDERSTOOD = 'not understood';
const MAX_ITEMS = 300;
const MAX_WARNINGS = 3;

/** Return an element with text (never markup) and children. */
export function element(tag, content = '', children = []) {
  const made = document.createElement(tag);
  made.textContent = text(content);
  made.append(...children);
  return made;
}

/** Return what a plan is called beside the others. */
export function nameOf(plan, plans = []) {
  const isFree = plans.some((other) => other.instruction);
  const names = {
    chosen: 'Your plan',
    no_waypoints: 'No waypoints',
    astar: isFree ? 'A*, without the instruction' : 'A*',
  };
  return names[plan.role] ?? text(plan.title, 60);
}

export function showVerdict({ tone, head, rest }) {
  $('verdict').dataset.tone = tone;
  $('verdict').replaceChildren(element('b', head), document.createTextNode(text(rest)));
}

/** Show all that is said about the plans of a reply. */
export function showReply(reply, map, palette) {
  const plans = reply.plans;
  const chosen = plans.find((plan) => plan.role === 'chosen');
  showVerdict(verdictOf(plans, map.isMetric));
  showWarnings(chosen?.warnings);
  showFigures(plans, map);
  showWaypoints(chosen?.waypoints ?? [], map, palette);
  showInstruction(chosen?.instruction);
  $('command-block').hidden = false;
  $('command').textContent = text(reply.command ?? '', 80000);
  $('command').parentElement.hidden = !reply.command;
  $('command-note').textContent = reply.command
    ? ''
    : `There is no command: ${text(reply.command_note, 300)}.`;
}

/** Say such as that the start or the goal was moved. */
export function showWarnings(warnings) {
  const sentences = (Array.isArray(warnings) ? warnings : [])
    .slice(0, MAX_WARNINGS)
    .map((warning) => text(warning, 400));
  $('moved').hidden = !sentences.length;
  $('moved').textContent = sentences
    .map((sentence) => `${sentence.charAt(0).toUpperCase()}${sentence.slice(1)}.`)
    .join(' ');
}

const ROWS = [
  ['Expansions', 'expansions', 0, true],
  ['Length', 'length', 2, false],
  ['At any angle', 'any_angle', 2, false],
  ['Proven within', 'bound', 3, false],
  ['Search (ms)', 'search_ms', 2, true],
  ['Waypoints (ms)', 'source_ms', 1, false],
  ['Turns', 'turns', 0, false],
  ['Clearance (m)', 'clearance_m', 2, false],
];

function showFigures(plans, map) {
  const head = element('thead', '', [
    element('tr', '', [
      element('td'),
      ...plans.map((plan) => {
        const cell = element('th', nameOf(plan, plans));
        cell.scope = 'col';
        return cell;
      }),
    ]),
  ]);
  $('figures').replaceChildren(
    head,
    element(
      'tbody',
      '',
      ROWS.filter((row) => row[1] === 'bound' || hasFigure(row, plans, map)).map((row) =>
        figureRow(row, plans, map),
      ),
    ),
  );
}

/** Return the length of a path in cells. */
function lengthOf(path) {
  return path
    .slice(1)
    .reduce((sum, [x, y], i) => sum + Math.hypot(x - path[i][0], y - path[i][1]), 0);
}

/** Return a figure of a plan, null where it has none, and its name with the unit. */
function figureOf(plan, title, key, map) {
  const isLength = ['length', 'any_angle'].includes(key);
  const isMetres = isLength && map.isMetric;
  const value =
    key === 'any_angle'
      ? lengthOf(points(plan.any_angle)) * (isMetres ? map.resolution : 1) || null
      : number(plan.figures?.[isMetres ? 'length_m' : key]);
  const isAsked = key === 'source_ms' ? value > 0 : plan.found || key === 'expansions';
  const unit = isLength ? ` (${isMetres ? 'm' : 'cells'})` : '';
  return { name: title + unit, value: isAsked ? value : null };
}

const hasFigure = ([title, key], plans, map) =>
  plans.some((plan) => figureOf(plan, title, key, map).value !== null);

function figureRow([title, key, digits, hasBar], plans, map) {
  const figures = plans.map((plan) => figureOf(plan, title, key, map));
  const known = figures.map(({ value }) => value).filter((value) => value !== null);
  const [least, most] = [Math.min(...known), Math.max(...known)];
  const header = element('th', figures[0]?.name ?? title);
  header.scope = 'row';
  const isRanked = ['expansions', 'length', 'search_ms'].includes(key) && least < most;
  return element('tr', '', [
    header,
    ...figures.map(({ value }, i) => {
      const cell = element(
        'td',
        key === 'bound' ? boundShown(value, digits, plans[i].found) : shown(value, digits),
      );
      cell.classList.toggle('best', isRanked && value === least && plans[i].found);
      if (hasBar && value !== null) cell.append(bar(most ? value / most : 0));
      return cell;
    }),
  ]);
}

function boundShown(value, digits, isFound) {
  if (value !== null) return `× ${shown(value, digits)}`;
  return isFound ? 'no proof' : '–';
}

function bar(part) {
  const made = element('div');
  made.className = 'bar';
  made.style.width = `${Math.max(1, 100 * part)}%`;
  return made;
}

export function showWaypoints(waypoints, map, palette) {
  $('waypoint-block').hidden = !waypoints.length;
  $('waypoints').replaceChildren(
    ...waypoints.slice(0, MAX_ITEMS).map((point) => {
      const { status } = point;
      const icon = markerIcon((context) =>
        drawMarker(
          context,
          statusShape(status),
          [10, 10],
          7,
          palette.waypoint[status] ?? '#7f7f7f',
          palette.edge,
          1,
        ),
      );
      const where = [point.x, point.y].map((value, axis) =>
        shown(map.axisValue(axis, value), map.isMetric ? 2 : Number(!Number.isInteger(value))),
      );
      const unit = map.isMetric ? ' m' : '';
      return element('li', '', [
        icon,
        element(
          'span',
          `${text(point.number, 6)}. (${where.join(', ')})${unit} ${statusName(status)}`,
        ),
      ]);
    }),
  );
}

/** Show the answer to a question about the path. */
export function showAnswer(answer) {
  $('answer').hidden = !answer;
  $('answer').textContent = answer ? text(answer.sentence, 2000) : '';
}

/** List the ways to choose from: how long, how narrow, and what they pass on the other side. */
export function showWays(ways, map, palette) {
  $('ways').hidden = !ways.length;
  const place = (point) => {
    const at = map.toGrid(point).map((value, axis) => map.axisValue(axis, value));
    return `(${at.map((value) => shown(value, map.isMetric ? 1 : 0)).join(', ')})`;
  };
  const unit = map.isMetric ? 'm' : 'cells';
  $('ways').replaceChildren(
    ...ways.map(({ length, clearance, around }, i) => {
      const others = points(around, 12).map(place).join(' and ');
      const said = [
        `way ${i + 1}: ${shown(length, 1)} ${unit}`,
        number(clearance) === null ? '' : `clearance ${shown(clearance, 2)} ${unit}`,
        others && `passes what is at ${others} on the other side`,
      ];
      return element('li', '', [
        markerIcon(lineIcon(wayColour(i, palette), 6)),
        element('span', said.filter(Boolean).join(', ')),
      ]);
    }),
  );
}

function lineIcon(colour, width, dash = []) {
  return (context) => {
    context.strokeStyle = colour;
    context.lineWidth = width;
    context.setLineDash(dash);
    context.beginPath();
    context.moveTo(1, 10);
    context.lineTo(19, 10);
    context.stroke();
  };
}

export function showInstruction(instruction) {
  const questions = Array.isArray(instruction?.questions) ? instruction.questions : [];
  $('question').hidden = !questions.length;
  $('question-text').textContent = text(questions.join(' '), 1000);
  $('instruction-block').hidden = !instruction;
  if (!instruction) return;
  const clauses = Array.isArray(instruction.clauses) ? instruction.clauses : [];
  $('sentence').hidden = instruction.status === NOT_UNDERSTOOD;
  $('sentence').textContent =
    `Read as: ${text(instruction.sentence, 1000)} (${text(instruction.status, 60)})`;
  $('instruction-note').textContent = text(instruction.note, 1000);
  $('clauses').replaceChildren(
    ...clauses.slice(0, MAX_ITEMS).map((clause) => {
      const status = element('span', text(clause.status, 30).toLowerCase());
      status.className = `status ${CLAUSE_TONES[clause.status] ?? 'soft'}`;
      const detail = element('span', text(clause.detail, 500));
      detail.className = 'detail';
      return element('li', '', [
        status,
        element('span', text(clause.clause, 500).replace(`${NOT_UNDERSTOOD}: `, '')),
        ...(clause.detail ? [detail] : []),
      ]);
    }),
  );
}

/** Say of which searches the animation has no order, or not all, and a note on the plans. */
export function showUnordered(plans, note) {
  const names = (isMeant) =>
    plans
      .filter((plan) => plan.figures?.expansions && isMeant(plan))
      .map((plan) => nameOf(plan, plans))
      .join(', ');
  const unordered = names((plan) => plan.order_is_known === false);
  const cut = names((plan) => plan.figures.expansions > MAX_ORDER);
  $('order-note').hidden = !unordered && !cut && !note;
  $('order-note').textContent = [
    note,
    unordered &&
      `The order of expansion is not known for: ${unordered}. The animation shows all these cells at once.`,
    cut && `Only the first ${shown(MAX_ORDER)} expansions are drawn for: ${cut}.`,
  ]
    .filter(Boolean)
    .join(' ');
}

/** Show what a node reports of its plan. */
export function showReport(plan, map) {
  const figures = ROWS.map(([title, key, digits]) => {
    const { name, value } = figureOf(plan, title, key, map);
    return [name, value === null ? '' : shown(value, digits)];
  });
  const warnings = (Array.isArray(plan.warnings) ? plan.warnings : [])
    .slice(0, MAX_ITEMS)
    .map((warning) => ['Warning', warning]);
  const title = text(plan.title, 80).replace('waypoints by none', 'no waypoints');
  const entries = [['Plan', title], ['In short', plan.message], ...figures, ...warnings].filter(([, value]) => value);
  $('report-block').hidden = false;
  $('report').replaceChildren(
    ...entries.flatMap(([name, value]) => [element('dt', name), element('dd', text(value, 400))]),
  );
}

const AREA_NAMES = { KEPT: 'kept', AS_FAR_AS_POSSIBLE: 'kept as far as possible', UNSURE: 'unsure' };

/** Return what the areas of an instruction are called, each look once, with how it is drawn. */
function areaEntries(areas, palette) {
  const names = areas.map((area) => {
    const became = AREA_NAMES[area.status] ?? 'not kept';
    return [`${area.is_avoided ? 'to avoid' : 'asked for'}, ${became}`, area];
  });
  return [...new Map(names)].map(([name, area]) => [name, areaIcon(area, palette)]);
}

/** Show the legend of what is on the map. */
export function showLegend(palette, shown) {
  const { expanded, closed, levels, areas, shapes, via, waypoints } = shown;
  const { causes, ways, other, rules } = shown;
  const kinds = new Set(rules.map(({ kind }) => kind).filter((kind) => kind in KINDS));
  const area = (colour) => (context) => {
    context.fillStyle = colour;
    context.strokeStyle = palette.axis;
    context.lineWidth = 0.8;
    context.fillRect(2, 4, 16, 12);
    context.strokeRect(2, 4, 16, 12);
  };
  const mark = (shape, colour) => (context) =>
    drawMarker(context, shape, [10, 10], 6.5, colour, palette.edge, 1);
  const zones = [...shapes, ...rules.filter(({ kind }) => !(kind in KINDS))];
  const zone = (name, isMeant) =>
    zones.some((shape) => shape.cost > FREE && isClosed(shape) === isMeant)
      ? [[name, areaIcon({ zone: isMeant }, palette)]]
      : [];
  const entries = [
    ['start', mark('square', palette.start)],
    ['goal', mark('diamond', palette.goal)],
    ['path', lineIcon(palette.path, 3)],
    ...ways.map((_, i) => [`way ${i + 1}`, lineIcon(wayColour(i, palette), 6)]),
    ...(other.length > 1
      ? [['path that was asked about', lineIcon(palette.clause.UNSURE, 3.5, [6, 4])]]
      : []),
    ...(causes.length ? [['closes the way', mark('cross', palette.clause.NOT_KEPT)]] : []),
    ...areaEntries(areas, palette),
    ...(expanded ? [['expanded by the search', area(palette.expanded)]] : []),
    ['obstacle', area(palette.obstacle)],
    ...(closed ? [['too close for the robot', area(palette.inflated)]] : []),
    ...(levels.at(-1) === WALL ? [['drawn wall', area(palette.wall)]] : []),
    ...(levels.some((level) => level > FREE && level < WALL)
      ? [['drawn cost', area(`${palette.wall}88`)]]
      : []),
    ...(levels[0] === FREE ? [['erased', area(palette.freed)]] : []),
    ...zone('closed zone', true),
    ...zone('zone that costs more', false),
    ...[...kinds].map((kind) => [KINDS[kind], ruleIcon(kind, palette)]),
    ...(via ? [['via point', mark('triangle', palette.via)]] : []),
    ...[...waypoints].map((status) => [
      `waypoint ${statusName(status)}`,
      mark(statusShape(status), palette.waypoint[status] ?? '#7f7f7f'),
    ]),
  ];
  $('legend').replaceChildren(
    ...entries.map(([name, draw]) => element('li', '', [markerIcon(draw), element('span', name)])),
  );
}
