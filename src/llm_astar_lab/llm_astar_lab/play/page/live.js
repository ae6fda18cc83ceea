// A running graph: its map, plans and reports, as server-sent events.

import {
  showInstruction,
  showReport,
  showVerdict,
  showWarnings,
  showWaypoints,
} from './results.js';
import { points, text } from './codec.js';
import { GridMap } from './gridmap.js';
import { planOf } from './plan.js';
import { say } from './toast.js';
import { verdictOf } from './verdict.js';

const $ = (id) => document.getElementById(id);
const WAITING = {
  tone: 'draw',
  head: 'Waiting for a plan.',
  rest: ' Send the planner a goal, from RViz, Nav2 or "llm-astar call", and its plan appears here.',
};

export class Live {
  /** Take the stage that shows the graph. */
  constructor(stage) {
    this.stage = stage;
    this.source = null;
    this.map = null;
    this.plan = null;
  }

  start() {
    showVerdict(WAITING);
    showWarnings([]);
    this.source = new EventSource('api/live');
    const on = (name, handle) =>
      this.source.addEventListener(name, (event) => this.take(event, handle));
    on('map', (data) => this.onMap(data));
    on('rules', (data) => this.onRules(data));
    on('plan', (data) => this.onPlan(data));
    on('status', (data) => this.onStatus(data));
    this.source.addEventListener('error', () => say('The server does not answer; trying again.'));
  }

  stop() {
    this.source?.close();
    this.source = null;
    say('');
  }

  take(event, handle) {
    try {
      handle(JSON.parse(event.data));
    } catch (error) {
      say(`An event cannot be shown: ${text(error.message, 200)}`);
    }
  }

  onMap(data) {
    const map = new GridMap(data);
    const isSame = this.map !== null && map.layout === this.map.layout;
    this.map = map;
    this.stage.setMap(map, isSame);
    this.stage.showLegend();
    if (isSame && this.plan) this.stage.setLivePlan(...this.plan);
  }

  onRules(rules) {
    this.stage.setRules(rules);
    this.stage.showLegend();
    this.stage.draw();
  }

  onStatus(data) {
    say(plainly(text(data.message, 400)));
  }

  onPlan(raw) {
    if (!this.map) return;
    const plan = planOf(raw);
    const path = points(plan.any_angle ?? plan.path);
    const ends = {
      start: points([plan.start])[0] ?? path[0],
      goal: points([plan.goal])[0] ?? path.at(-1),
      via: points(plan.via, 1000),
    };
    plan.regions ??= { areas: areasOf(plan.instruction, this.map.places) };
    this.plan = [plan, ends];
    this.stage.setLivePlan(plan, ends);
    showVerdict(verdictOf([{ ...plan, role: 'chosen' }], this.map.isMetric));
    showWarnings(plan.warnings);
    showReport(plan, this.map);
    showInstruction(plan.instruction);
    showWaypoints(
      Array.isArray(plan.waypoints) ? plan.waypoints : [],
      this.map,
      this.stage.palette,
    );
  }
}

/** Return what the planner says of its state in plain words. */
function plainly(message) {
  const [, node, size] = /^(\S+): planning on map \w+ of (\d+ x \d+ cells)/.exec(message) ?? [];
  if (size) return `${node} is ready, on a map of ${size.replace('x', '×')}.`;
  return `${message.charAt(0).toUpperCase()}${message.slice(1)}.`;
}

/** Return the areas of the places that clauses name: a report says no more of its regions. */
function areasOf(instruction, places) {
  const clauses = Array.isArray(instruction?.clauses) ? instruction.clauses.slice(0, 100) : [];
  return clauses.flatMap((clause) => {
    const named = places.filter(({ name }) => text(clause.clause).endsWith(` ${name}`));
    return named.map(({ polygon }) => ({
      rings: [polygon],
      is_avoided: /^(avoid|keep|never)/.test(text(clause.clause)),
      status: text(clause.status, 40).toUpperCase().replaceAll(' ', '_'),
    }));
  });
}

/** Let the buttons of the header choose between planning here and the running graph. */
export function listenToModes(onMode) {
  $('modes').hidden = false;
  $('modes').addEventListener('click', (event) => {
    const { mode } = event.target.dataset;
    if (!mode) return;
    for (const button of $('modes').children)
      button.setAttribute('aria-pressed', String(button === event.target));
    onMode(mode);
  });
}
