// A running graph: its map, plans and reports, as server-sent events.

import { showInstruction, showReport, showVerdict, showWaypoints } from './results.js';
import { points, shown, text } from './codec.js';
import { GridMap } from './gridmap.js';

const $ = (id) => document.getElementById(id);
const WAITING = { tone: 'draw', head: 'Waiting for a plan.', rest: ' Send a goal to the planner, and it appears here.' };

export class Live {
  /** Take what draws: `setMap(map)`, `setPlan(plan, ends)`, and `palette()`. */
  constructor(stage) {
    this.stage = stage;
    this.source = null;
    this.map = null;
  }

  start() {
    showVerdict(WAITING);
    this.source = new EventSource('api/live');
    const on = (name, handle) => this.source.addEventListener(name, (event) => this.take(event, handle));
    on('map', (data) => this.onMap(data));
    on('plan', (data) => this.onPlan(data));
    on('status', (data) => this.onStatus(data));
    this.source.addEventListener('error', () => this.say('The server does not answer; trying again.'));
  }

  stop() {
    this.source?.close();
    this.source = null;
    $('notice').hidden = true;
  }

  take(event, handle) {
    try {
      handle(JSON.parse(event.data));
    } catch (error) {
      this.say(`An event cannot be shown: ${text(error.message, 200)}`);
    }
  }

  say(sentence) {
    $('notice').textContent = text(sentence, 400);
    $('notice').hidden = !sentence;
  }

  onMap(data) {
    this.map = new GridMap(data);
    this.stage.setMap(this.map);
  }

  onStatus(data) {
    this.say(typeof data === 'string' ? data : data.message ?? data.status ?? '');
  }

  onPlan(plan) {
    if (!this.map) return;
    const path = points(plan.any_angle ?? plan.path);
    const ends = {
      start: points([plan.start])[0] ?? path[0], goal: points([plan.goal])[0] ?? path.at(-1), via: points(plan.via, 1000),
    };
    this.stage.setPlan(plan, ends);
    const report = plan.report ?? {};
    const isFound = plan.found ?? path.length > 0;
    const length = report.length_m ?? report.length;
    showVerdict(isFound
      ? { tone: 'win', head: 'Path found:', rest: ` ${shown(length, 2)} m, ${shown(report.expansions)} expansions.` }
      : { tone: 'fail', head: 'No path:', rest: ` ${text(plan.message ?? report.message, 400)}` });
    showReport(report);
    showInstruction(plan.instruction);
    showWaypoints(Array.isArray(plan.waypoints) ? plan.waypoints : [], this.map, this.stage.palette());
  }
}

/** Let the buttons of the header choose between planning here and the running graph. */
export function listenToModes(onMode) {
  $('modes').hidden = false;
  $('modes').addEventListener('click', (event) => {
    const { mode } = event.target.dataset;
    if (!mode) return;
    for (const button of $('modes').children) button.setAttribute('aria-pressed', String(button === event.target));
    onMode(mode);
  });
}
