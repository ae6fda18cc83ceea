// Puts the page together: settings and map in, plans out, everything drawn.

import * as api from './api.js';
import { Board } from './board.js';
import { bits, number, shown, text } from './codec.js';
import { Controls } from './controls.js';
import { GridMap } from './gridmap.js';
import { decodeRuns, defaultSettings, fromFragment, toFragment } from './link.js';
import { MapLayer } from './layers.js';
import { listenToModes, Live } from './live.js';
import { Panel } from './panel.js';
import { Player } from './player.js';
import { suggestedReply } from './reply.js';
import { nameOf, showLegend, showReply, showUnordered, showVerdict } from './results.js';
import { palette, watchScheme } from './theme.js';
import { copy, say } from './toast.js';
import { Viewport } from './viewport.js';
import { MAX_EDITED, Walls } from './walls.js';

const $ = (id) => document.getElementById(id);
const LINK_DELAY_MS = 200;
const SLOW_MS = 700;
// Pixels around the main map that are to be seen with it, and its least height.
const AROUND = 330;
const LEAST_HEIGHT = 340;
// By how much two small maps are lower than the main one, so that the columns end together.
const BETWEEN = 62;

class Page {
  constructor(options) {
    this.options = options;
    this.settings = defaultSettings();
    this.viewport = new Viewport();
    this.panels = [...document.querySelectorAll('.panel')].map((figure) =>
      new Panel(figure, this.viewport, figure.dataset.role === 'chosen'));
    this.palette = palette(options.colours, watchScheme((isDark) => this.repaint(isDark)));
    this.ends = null;
    this.lethal = null;
    this.player = new Player(() => this.draw());
    this.board = new Board(this.panels[0], this.callbacks());
    this.controls = new Controls(options, this.settings, (name) => this.settingChanged(name), (id) => this.openMap(id));
    this.queue = new api.PlanQueue(
      (reply, request, isNewest) => this.onPlans(reply, request, isNewest), (error) => this.onError(error));
    this.listen();
  }

  callbacks() {
    return {
      state: () => ({ map: this.map, ends: this.live ? null : this.ends, walls: this.walls }),
      moved: (name, cell, isDone) => this.moved(name, cell, isDone),
      painted: (indices, isDone) => this.painted(indices, isDone),
      added: (cell) => this.changeVia((via) => [...via, cell]),
      removed: (index) => this.changeVia((via) => via.filter((_, i) => i !== index)),
      panned: () => this.draw(),
    };
  }

  listen() {
    $('undo').addEventListener('click', () => this.editWalls(() => this.walls.undo()));
    $('redo').addEventListener('click', () => this.editWalls(() => this.walls.redo()));
    $('clear').addEventListener('click', () => this.clearEdits());
    $('zoom-in').addEventListener('click', () => this.zoom(1.5));
    $('zoom-out').addEventListener('click', () => this.zoom(1 / 1.5));
    $('zoom-fit').addEventListener('click', () => this.zoom(0));
    $('pair-back').addEventListener('click', () => this.choosePair(-1));
    $('pair-next').addEventListener('click', () => this.choosePair(1));
    $('copy-link').addEventListener('click', () => this.copyLink());
    $('copy-command').addEventListener('click', () => copy($('command').textContent, 'The command is copied.'));
    document.addEventListener('keydown', (event) => this.onKey(event));
    addEventListener('hashchange', () => this.live || this.openLink(fromFragment(location.hash)));
    new ResizeObserver(() => this.resize()).observe($('main'));
  }

  /** Show what the address says, else the first map. */
  async open() {
    await this.openLink(fromFragment(location.hash) ?? { map: this.options.maps[0].id });
    this.board.showHint();
    if (this.hasPlans && !matchMedia('(prefers-reduced-motion: reduce)').matches) this.player.play();
  }

  async openLink(view) {
    if (!view) return;
    const isKnown = this.options.maps.some((map) => map.id === view.map);
    say(isKnown ? '' : `The link names a map that is not here, ${text(view.map, 80)}; this is another one.`);
    Object.assign(this.settings, defaultSettings(), view.settings);
    await this.openMap(isKnown ? view.map : this.options.maps[0].id, isKnown ? view : {});
  }

  /** Open a map; `view` has what a link says of it. */
  async openMap(id, view = {}) {
    this.opening = id;
    try {
      const map = new GridMap(await api.mapOf(id));
      if (this.opening !== id || this.live) return;
      this.setMap(map);
    } catch (error) {
      this.onError(error.field === undefined ? new api.ServerError(error.message, 'map') : error);
      return;
    }
    const pair = this.map.defaultPair();
    const cell = (name) => (this.map.has(view[name]) ? view[name] : pair[name]);
    this.ends = { start: cell('start'), goal: cell('goal'), via: (view.via ?? []).filter((via) => this.map.has(via)) };
    const size = this.map.cells.length;
    for (const index of decodeRuns(view.walls ?? '', size, MAX_EDITED)) this.walls.edits.set(index, true);
    for (const index of decodeRuns(view.freed ?? '', size, MAX_EDITED - this.walls.edits.size)) this.walls.edits.set(index, false);
    if (view.settings === undefined) Object.assign(this.settings, { corner_cutting: null, robot_radius: null });
    this.controls.setMap(this.map);
    this.renderBase();
    await this.replan();
  }

  /** Take another map; `isSame` keeps the view. */
  setMap(map, isSame = false) {
    this.map = map;
    this.walls = new Walls(map);
    this.lethal = null;
    this.hasPlans = false;
    if (!isSame) this.viewport.reset();
    this.base = new MapLayer(map);
    for (const panel of this.panels) panel.setMap(map, this.base);
    this.player.setTotal(0);
    this.renderBase();
    this.resize();
  }

  renderBase() {
    this.base.render(this.walls, this.lethal, this.palette);
    this.draw();
  }

  request() {
    const { start, goal, via } = this.ends;
    const { reply, instruction, source, ...settings } = this.settings;
    const isTyped = source === 'reply' && reply.trim() !== '';
    return {
      map: this.map.id, start, goal, via, ...settings, source: isTyped || source !== 'reply' ? source : 'none',
      reply: isTyped ? reply : null, instruction: instruction.trim() || null, walls: this.walls.toRequest(),
    };
  }

  async replan() {
    this.linkSoon();
    this.showEditing();
    $('main').setAttribute('aria-busy', 'true');
    const timer = setTimeout(() => this.sayPlanning(), SLOW_MS);
    await this.queue.ask(this.request());
    clearTimeout(timer);
    if (!this.queue.busy) $('planning').hidden = true;
  }

  sayPlanning() {
    $('planning').hidden = Boolean(this.live);
    if (this.hasPlans || this.live) return;
    showVerdict({ tone: 'draw', head: 'Planning …', rest: ' The first plan takes some seconds, while the searches are compiled.' });
  }

  onPlans(reply, request, isNewest) {
    if (request.map !== this.map?.id || this.live) return;
    this.plans = (Array.isArray(reply.plans) ? reply.plans : []).slice(0, 3);
    this.hasPlans = true;
    this.controls.showError(null);
    $('main').setAttribute('aria-busy', String(!isNewest));
    document.querySelector('.panels').classList.remove('stale');
    this.lethal = bits(reply.lethal, this.map.cells.length);
    for (const panel of this.panels) this.fillPanel(panel);
    showReply({ ...reply, plans: this.plans }, this.map, this.palette);
    showUnordered(this.plans);
    this.renderBase();
    this.player.setTotal(Math.max(0, ...this.plans.map((plan) => number(plan.figures?.expansions) ?? 0)));
    this.showLegend();
    this.resize();
  }

  fillPanel(panel) {
    const plan = this.plans.find((item) => item.role === panel.figure.dataset.role);
    panel.figure.hidden = !plan;
    panel.setPlan(plan ?? null);
    if (!plan) return;
    const { expansions, length, length_m: metres } = plan.figures ?? {};
    const counts = this.plans.filter((item) => item.found).map((item) => number(item.figures?.expansions) ?? Infinity);
    const least = Math.min(...counts);
    const figure = this.map.isMetric ? `${shown(metres, 2)} m` : `${shown(length, 2)} cells`;
    panel.figure.querySelector('.title').textContent = plan.role === 'chosen' ? text(plan.title, 80) : nameOf(plan);
    panel.figure.querySelector('.figures').textContent = plan.found ? `${shown(expansions)} expansions, ${figure}` : `no path, ${shown(expansions)} expansions`;
    const badge = panel.figure.querySelector('.badge');
    badge.textContent = 'fewest expansions';
    badge.hidden = !(plan.found && expansions === least && counts.length > 1 && counts.filter((count) => count === least).length === 1);
  }

  onError(error) {
    $('main').setAttribute('aria-busy', 'false');
    this.controls.showError(error);
    document.querySelector('.panels').classList.add('stale');
    showVerdict({ tone: 'fail', head: 'This cannot be planned.', rest: error.field ? ' The field in red says why.' : ` ${error.message}` });
  }

  draw() {
    if (!this.map || !this.panels[0].box) return;
    for (const panel of this.panels) {
      if (panel.figure.hidden || !panel.box) continue;
      const expansions = number(panel.plan?.figures?.expansions) ?? 0;
      panel.draw(this.ends ?? { via: [] }, this.live ? 1 : this.player.partOf(expansions), this.palette);
    }
    this.board.placeHandles();
  }

  resize() {
    if (!this.map) return;
    const [main, ...sides] = this.panels;
    main.resize(Math.max(LEAST_HEIGHT, innerHeight - AROUND));
    for (const side of sides) side.resize((main.canvas.clientHeight - BETWEEN) / 2);
    this.draw();
  }

  repaint(isDark) {
    this.palette = palette(this.options.colours, isDark);
    if (!this.map) return;
    this.renderBase();
    this.showLegend();
  }

  showLegend() {
    const waypoints = new Set((this.panels[0].plan?.waypoints ?? []).map((point) => text(point.status, 30)));
    const closed = (this.lethal ?? []).some((value, index) => value && !this.walls.isBlocked(index));
    showLegend(this.palette, {
      closed, waypoints, expanded: this.panels[0].search?.order.length > 0, drawn: this.walls.has(true), erased: this.walls.has(false), via: this.ends?.via.length,
    });
  }

  moved(name, cell, isDone) {
    this.board.hideHint();
    if (cell) {
      const target = typeof name === 'number' ? this.ends.via : this.ends;
      if (String(target[name]) === String(cell)) return;
      target[name] = cell;
      this.draw();
    }
    if (cell || !isDone) this.replan();
  }

  painted(indices, isDone) {
    this.base.paint(this.walls, indices);
    this.draw();
    if (isDone) this.replan();
  }

  editWalls(edit) {
    edit();
    this.renderBase();
    this.replan();
  }

  clearEdits() {
    this.ends.via = [];
    this.editWalls(() => this.walls.clear());
  }

  changeVia(change) {
    this.ends.via = change(this.ends.via).slice(0, 100);
    this.draw();
    this.replan();
  }

  settingChanged(name) {
    if (name === 'source' && this.settings.source === 'reply' && !this.settings.reply) {
      this.settings.reply = suggestedReply(this.panels[0].path, this.map);
      this.controls.show();
    }
    this.replan();
  }

  choosePair(step) {
    const { pairs } = this.map;
    const now = this.pairIndex();
    const next = now < 0 ? 0 : (now + step + pairs.length) % pairs.length;
    this.ends = { ...this.ends, start: [...pairs[next].start], goal: [...pairs[next].goal] };
    this.draw();
    this.replan();
  }

  pairIndex() {
    const { start, goal } = this.ends;
    return this.map.pairs.findIndex((pair) => String([pair.start, pair.goal]) === String([start, goal]));
  }

  showEditing() {
    const { pairs } = this.map;
    const index = this.pairIndex();
    $('pairs').hidden = pairs.length === 0;
    $('pair-name').textContent = index < 0 ? 'your own start and goal' : `example ${index + 1} of ${pairs.length}`;
    $('undo').disabled = this.walls.done.length === 0;
    $('redo').disabled = this.walls.undone.length === 0;
    $('clear').disabled = !this.walls.isEdited && this.ends.via.length === 0;
  }

  zoom(factor) {
    if (factor) this.viewport.zoomBy(factor, this.map);
    else this.viewport.reset();
    this.draw();
  }

  onKey(event) {
    const isTyping = ['TEXTAREA', 'INPUT'].includes(event.target.tagName) && event.target.type !== 'range';
    if (isTyping || this.live || !(event.ctrlKey || event.metaKey) || event.key.toLowerCase() !== 'z') return;
    event.preventDefault();
    this.editWalls(() => (event.shiftKey ? this.walls.redo() : this.walls.undo()));
  }

  linkSoon() {
    clearTimeout(this.linkTimer);
    this.linkTimer = setTimeout(() => this.writeLink(), LINK_DELAY_MS);
  }

  /** Put the view into the address. Returns whether all of it fits. */
  writeLink() {
    const { fragment, fits } = toFragment({
      ...this.ends, map: this.map.id, settings: this.controls.linkSettings(),
      blocked: this.walls.indices(true), freed: this.walls.indices(false),
    });
    history.replaceState(null, '', `#${fragment}`);
    return fits;
  }

  copyLink() {
    const fits = this.writeLink();
    copy(location.href, fits ? 'The link is copied.' : 'The link is copied without walls and texts: they are too long for a link.');
  }

  showMode(mode) {
    const isLive = mode === 'live';
    document.body.classList.toggle('live', isLive);
    clearTimeout(this.linkTimer);
    this.ends = null;
    this.map = undefined;
    if (!isLive) {
      this.live?.stop();
      this.live = null;
      $('report-block').hidden = true;
      this.openLink(fromFragment(location.hash) ?? { map: this.options.maps[0].id });
      return;
    }
    this.player.pause();
    this.board.hideHint();
    for (const part of ['.title', '.figures']) this.panels[0].figure.querySelector(part).textContent = '';
    this.panels[0].figure.querySelector('.badge').hidden = true;
    this.live = new Live({ setMap: (map, isSame) => this.setLiveMap(map, isSame), setPlan: (plan, ends) => this.setLivePlan(plan, ends), palette: () => this.palette });
    this.live.start();
  }

  setLiveMap(map, isSame) {
    this.setMap(map, isSame);
    this.ends = { via: [] };
    this.showLegend();
  }

  setLivePlan(plan, ends) {
    this.ends = ends;
    this.panels[0].setPlan(plan);
    this.draw();
    this.showLegend();
  }
}

async function begin() {
  try {
    const options = await api.options();
    $('version').textContent = text(options.version, 20);
    if (!options.maps?.length) throw new Error('The server has no maps. Start it with one: llm-astar play --map FILE');
    const page = new Page(options);
    if (options.live) listenToModes((mode) => page.showMode(mode));
    if (options.live && !location.hash) document.querySelector('[data-mode="live"]').click();
    else await page.open();
  } catch (error) {
    showVerdict({ tone: 'fail', head: 'The page cannot start.', rest: ` ${text(error.message, 400)}` });
  }
}

begin();
