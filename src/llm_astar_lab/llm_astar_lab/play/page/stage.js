// The maps side by side: which map, which plans, what of it is seen, in which colours.

import { number, objects, points, shown, text } from './codec.js';
import { MapLayer } from './layers.js';
import { Panel } from './panel.js';
import { nameOf, showLegend, showWays } from './results.js';
import { palette, watchScheme } from './theme.js';
import { Viewport } from './viewport.js';
import { Edits } from './edits.js';
import { isInside, isZone, shapeOf } from './shapes.js';

// Pixels around the main map that are to be seen with it, and its least height.
const AROUND = 405;
const LEAST_HEIGHT = 360;
// Of the small maps.
const SMALL_HEIGHT = 210;
const MAX_RULES = 400;

export class Stage {
  /**
   * Take the server's colours, and callbacks: `partOf(expansions)` says how much (0 to 1) of a
   * search is shown, `drawn()` is called after each drawing.
   */
  constructor(colours, callbacks) {
    this.colours = colours;
    this.callbacks = callbacks;
    this.viewport = new Viewport();
    this.panels = [...document.querySelectorAll('.panel')].map(
      (figure) => new Panel(figure, this.viewport, figure.dataset.role === 'chosen'),
    );
    const isDark = watchScheme((isNowDark) => this.repaint(isNowDark));
    this.palette = palette(colours, isDark);
    this.map = null;
    this.ends = null;
  }

  get main() {
    return this.panels[0];
  }

  /** Take another map; `isSame` keeps the view. */
  setMap(map, isSame = false) {
    this.map = map;
    this.ends = null;
    this.edits = new Edits(map);
    this.main.draft = [];
    if (!isSame) this.setRules();
    this.lethal = null;
    if (!isSame) this.viewport.reset();
    this.base = new MapLayer(map);
    for (const panel of this.panels) panel.setMap(map, this.base);
    this.renderBase();
    this.resize();
  }

  /** Draw the map again, after its walls or its closed cells have changed. */
  renderBase() {
    this.main.shapes = this.edits.features.map((feature) => shapeOf(feature, this.map));
    this.base.render(this.edits, this.lethal, this.palette);
    this.draw();
  }

  /** Return the places, those of the map first, as {name, polygon}. */
  places() {
    const drawn = this.edits.features.filter((feature) => !isZone(feature));
    const shapes = drawn.map((feature) => shapeOf(feature, this.map));
    return [
      ...this.map.places,
      ...shapes.map(({ name, rings }) => ({ name, polygon: rings[0] ?? [] })),
    ];
  }

  /** Return the places and zones at a point in cells, the smallest first. */
  shapesAt(point) {
    const zones = this.main.shapes.filter(({ cost }) => cost !== undefined);
    const rules = this.main.rules.map((rule) => ({ ...rule, cost: number(rule.cost) ?? 0 }));
    return [
      ...this.places().toReversed(),
      ...[...zones, ...rules].map((zone) => ({ ...zone, polygon: points(zone.rings?.[0]) })),
    ].filter(({ polygon }) => isInside(point, polygon));
  }

  /** Draw some cells of the map again, by their indices. */
  paint(indices) {
    this.base.paint(this.edits, indices);
    this.draw();
  }

  /** Show rules of the road, and the other path of an answer. */
  setRules(rules, other) {
    this.main.rules = objects(rules, MAX_RULES);
    this.main.other = points(other);
  }

  /** Show up to three plans, and which cells are closed to the robot (1 for each). */
  setPlans(plans, lethal) {
    this.lethal = lethal;
    for (const panel of this.panels) this.fillPanel(panel, plans);
    this.renderBase();
    this.showLegend();
    showWays(this.main.ways, this.map, this.palette);
    this.resize();
  }

  fillPanel(panel, plans) {
    const plan = plans.find((item) => item.role === panel.figure.dataset.role);
    panel.figure.hidden = !plan;
    panel.setPlan(plan ?? null);
    if (!plan) return;
    const { expansions, length, length_m: metres } = plan.figures ?? {};
    const counts = plans
      .filter((item) => item.found)
      .map((item) => number(item.figures?.expansions) ?? Infinity);
    const least = Math.min(...counts);
    const work = `${shown(expansions)} expansion${expansions === 1 ? '' : 's'}`;
    const figure = this.map.isMetric ? `${shown(metres, 2)} m` : `${shown(length, 2)} cells`;
    panel.figure.querySelector('.title').textContent =
      plan.role === 'chosen' ? text(plan.title, 80) : nameOf(plan, plans);
    panel.figure.querySelector('.figures').textContent = plan.found
      ? `${work}, ${figure}`
      : `no path, ${work}`;
    const badge = panel.figure.querySelector('.badge');
    badge.textContent = 'fewest expansions';
    // An instruction has its price, which the other maps do not pay.
    badge.hidden = !(
      !plans.some((item) => item.instruction) &&
      plan.found &&
      expansions === least &&
      counts.length > 1 &&
      counts.filter((count) => count === least).length === 1
    );
  }

  /** Show an outline that is not a place or a zone yet. */
  showDraft(polygon) {
    this.main.draft = polygon;
    this.draw();
  }

  /** Show one plan of a running graph with its start, goal and via points. */
  setLivePlan(plan, ends) {
    this.ends = ends;
    this.main.setPlan(plan);
    this.draw();
    this.showLegend();
  }

  /** Remove what was said about the plan of the main map. */
  clearCaption() {
    const { figure } = this.main;
    for (const part of ['.title', '.figures']) figure.querySelector(part).textContent = '';
    figure.querySelector('.badge').hidden = true;
  }

  draw() {
    if (!this.map || !this.main.box) return;
    for (const panel of this.panels) {
      if (panel.figure.hidden || !panel.box) continue;
      const expansions = number(panel.plan?.figures?.expansions) ?? 0;
      panel.draw(this.ends ?? { via: [] }, this.callbacks.partOf(expansions), this.palette);
    }
    this.callbacks.drawn();
  }

  resize() {
    if (!this.map) return;
    const [main, ...sides] = this.panels;
    main.resize(Math.max(LEAST_HEIGHT, innerHeight - AROUND));
    for (const side of sides) side.resize(SMALL_HEIGHT);
    this.draw();
  }

  repaint(isDark) {
    this.palette = palette(this.colours, isDark);
    if (!this.map) return;
    this.renderBase();
    this.showLegend();
    showWays(this.main.ways, this.map, this.palette);
  }

  showLegend() {
    const waypoints = new Set(
      (this.main.plan?.waypoints ?? []).map((point) => text(point.status, 30)),
    );
    const closed = (this.lethal ?? []).some(
      (value, index) => value && !this.edits.isBlocked(index),
    );
    showLegend(this.palette, {
      closed,
      waypoints,
      expanded: this.main.search?.order.length > 0,
      levels: this.edits.levels(),
      areas: this.main.plan?.regions?.areas ?? [],
      causes: this.main.causes,
      ways: this.main.ways,
      other: this.main.other,
      rules: this.main.rules,
      shapes: this.main.shapes,
      via: this.ends?.via.length,
    });
  }

  zoom(factor) {
    if (factor) this.viewport.zoomBy(factor, this.map);
    else this.viewport.reset();
    this.draw();
  }
}
