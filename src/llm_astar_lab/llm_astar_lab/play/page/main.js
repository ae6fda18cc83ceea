// Puts the page together: settings and map in, plans out, everything drawn.

import * as api from './api.js';
import { Board } from './board.js';
import { Bubbles } from './bubbles.js';
import { bits, number, objects, text } from './codec.js';
import { Controls } from './controls.js';
import { FREE, WALL } from './edits.js';
import { EXAMPLES, markExample, showExamples } from './examples.js';
import { listenToFiles, readFiles } from './files.js';
import { GridMap } from './gridmap.js';
import { applyDrawn, defaultSettings, fromFragment, toFragment } from './link.js';
import { listenToModes, Live } from './live.js';
import { planOf } from './plan.js';
import { Player } from './player.js';
import { suggestedReply } from './reply.js';
import { showAnswer, showReply, showUnordered, showVerdict } from './results.js';
import { featureOf, freeName, KINDS, saveFeatures } from './shapes.js';
import { Stage } from './stage.js';
import { copy, say } from './toast.js';

const $ = (id) => document.getElementById(id);
const LINK_DELAY_MS = 200;
const SLOW_MS = 700;
const COUNTS_COSTS = ['guided', 'exact_astar'];
// Settings that another map does not keep.
const OF_THE_MAP = { corner_cutting: null, robot_radius: null, reply: '', instruction: '', why: '' };

class Page {
  constructor(options) {
    this.options = options;
    this.settings = defaultSettings();
    this.stage = new Stage(options.colours, {
      partOf: (expansions) => (this.live ? 1 : this.player.partOf(expansions)),
      drawn: () => this.board.placeHandles(),
    });
    this.player = new Player(() => this.stage.draw());
    this.board = new Board(this.stage.main, this.callbacks());
    this.bubbles = new Bubbles(
      this.stage,
      (verb, name) => this.controls.addClause(verb, name),
      (polygon, name) => this.addFeature(polygon, { name }),
    );
    this.controls = new Controls(
      options,
      this.settings,
      (name) => this.settingChanged(name),
      (id) => this.openMap(id),
    );
    this.queue = new api.PlanQueue(
      (reply, request, isNewest) => this.onPlans(reply, request, isNewest),
      (error) => this.onError(error),
    );
    this.listen();
  }

  callbacks() {
    return {
      state: () => ({
        map: this.stage.map,
        edits: this.stage.edits,
        ends: this.live ? null : this.stage.ends,
        lethal: this.stage.lethal,
        shapes: (cell) => this.stage.shapesAt(cell),
      }),
      moved: (name, cell, isDone) => this.moved(name, cell, isDone),
      painted: (indices, isDone) => this.painted(indices, isDone),
      added: (cell) => this.changeVia((via) => [...via, cell]),
      removed: (index) => this.changeVia((via) => via.filter((_, i) => i !== index)),
      drafted: (polygon) => this.stage.showDraft(polygon),
      outlined: (polygon, tool) => this.outlined(polygon, tool),
      pressed: (point) => this.pressed(point),
      panned: () => this.stage.draw(),
    };
  }

  listen() {
    $('undo').addEventListener('click', () => this.edit((edits) => edits.undo()));
    $('redo').addEventListener('click', () => this.edit((edits) => edits.redo()));
    $('clear').addEventListener('click', () => this.clearEdits());
    $('save').addEventListener('click', () =>
      saveFeatures(this.stage.map, this.stage.edits.features),
    );
    showExamples($('examples'), (view) => {
      this.board.hideHint();
      this.openExample(view);
    });
    listenToFiles($('main'), $('files'), (files) => this.live || this.openFiles(files));
    $('zoom-in').addEventListener('click', () => this.stage.zoom(1.5));
    $('zoom-out').addEventListener('click', () => this.stage.zoom(1 / 1.5));
    $('zoom-fit').addEventListener('click', () => this.stage.zoom(0));
    $('pair-back').addEventListener('click', () => this.choosePair(-1));
    $('pair-next').addEventListener('click', () => this.choosePair(1));
    $('answer-yes').addEventListener('click', () => this.answer(true));
    $('answer-no').addEventListener('click', () => this.answer(false));
    $('copy-link').addEventListener('click', () => this.copyLink());
    $('copy-command').addEventListener('click', () =>
      copy($('command').textContent, 'The command is copied.'),
    );
    document.addEventListener('keydown', (event) => this.onKey(event));
    addEventListener('hashchange', () => this.live || this.openLink(fromFragment(location.hash)));
    new ResizeObserver(() => this.stage.resize()).observe($('main'));
  }

  /** Show what the address says, else the first example. */
  async open() {
    if (fromFragment(location.hash)) await this.openLink(fromFragment(location.hash));
    else await this.openExample(EXAMPLES[0].view);
    this.board.showHint();
    if (this.hasPlans && !this.plans[0]?.instruction && !matchMedia('(prefers-reduced-motion: reduce)').matches)
      this.player.play();
  }

  async openExample(view) {
    await this.openLink(fromFragment(view));
    markExample($('examples'), $('example-about'), view);
  }

  async openLink(view) {
    if (!view) return;
    markExample($('examples'), $('example-about'), null);
    const isKnown = this.options.maps.some((map) => map.id === view.map);
    say(
      isKnown
        ? ''
        : `The link names a map that is not here, ${text(view.map, 80)}; this is another one.`,
    );
    Object.assign(this.settings, defaultSettings(), view.settings);
    await this.openMap(isKnown ? view.map : this.options.maps[0].id, isKnown ? view : {});
  }

  /** Open a map; `view` has what a link says of it. */
  async openMap(id, view = {}) {
    this.opening = id;
    try {
      const map = new GridMap(await api.mapOf(id));
      if (this.opening !== id || this.live) return;
      this.hasPlans = false;
      this.bubbles.close();
      this.player.setTotal(0);
      this.stage.setMap(map);
    } catch (error) {
      this.onError(error.field === undefined ? new api.ServerError(error.message, 'map') : error);
      return;
    }
    const pair = this.stage.map.defaultPair();
    const cell = (name) => (this.stage.map.has(view[name]) ? view[name] : pair[name]);
    this.stage.ends = {
      start: cell('start'),
      goal: cell('goal'),
      via: (view.via ?? []).filter((via) => this.stage.map.has(via)),
    };
    applyDrawn(view, this.stage.edits);
    if (view.settings === undefined) Object.assign(this.settings, OF_THE_MAP);
    if (this.settings.source === 'reply' && !this.settings.reply)
      this.settings.source = 'none';
    this.controls.setMap(this.stage.map);
    this.controls.showPlaces(this.stage.places());
    this.stage.renderBase();
    await this.replan();
  }

  request() {
    const { start, goal, via } = this.stage.ends;
    const { reply, instruction, source, why, ...settings } = this.settings;
    const { features } = this.stage.edits;
    const isTyped = source === 'reply' && reply.trim() !== '';
    return {
      map: this.stage.map.id,
      start,
      goal,
      via,
      ...settings,
      source: isTyped || source !== 'reply' ? source : 'none',
      reply: isTyped ? reply : null,
      instruction: instruction.trim() || null,
      why: why.trim() || null,
      walls: this.stage.edits.toRequest(),
      drawn: features.length ? JSON.stringify({ type: 'FeatureCollection', features }) : null,
    };
  }

  async replan(answer = {}) {
    this.linkSoon();
    this.showEditing();
    $('main').setAttribute('aria-busy', 'true');
    const timer = setTimeout(() => this.sayPlanning(), SLOW_MS);
    await this.queue.ask({ ...this.request(), ...answer });
    clearTimeout(timer);
    if (!this.queue.busy) $('planning').hidden = true;
  }

  sayPlanning() {
    $('planning').hidden = Boolean(this.live);
    if (this.hasPlans || this.live) return;
    showVerdict({
      tone: 'draw',
      head: 'Planning …',
      rest: ' The first plan takes some seconds, while the searches are compiled.',
    });
  }

  onPlans(reply, request, isNewest) {
    if (request.map !== this.stage.map?.id || this.live) return;
    this.plans = objects(reply.plans, 3).map(planOf);
    this.hasPlans = true;
    this.controls.showError(null);
    $('main').setAttribute('aria-busy', String(!isNewest));
    $('main').classList.remove('stale');
    showReply({ ...reply, plans: this.plans }, this.stage.map, this.stage.palette);
    showAnswer(reply.answer);
    showUnordered(this.plans, this.ignoresCosts(request.method));
    this.stage.setRules(reply.rules, reply.answer?.path);
    this.stage.setPlans(this.plans, bits(reply.lethal, this.stage.map.cells.length));
    this.player.setTotal(
      Math.max(0, ...this.plans.map((plan) => number(plan.figures?.expansions) ?? 0)),
    );
  }

  onError(error) {
    $('main').setAttribute('aria-busy', 'false');
    this.controls.showError(error);
    $('main').classList.add('stale');
    showVerdict({
      tone: 'fail',
      head: 'This cannot be planned.',
      rest: error.field ? ' The field in red says why.' : ` ${error.message}`,
    });
  }

  /** Answer the questions that are shown; the server remembers it for this map. */
  answer(isMeant) {
    $('question').hidden = true;
    this.replan({ confirm: isMeant });
  }

  moved(name, cell, isDone) {
    this.board.hideHint();
    this.bubbles.close();
    if (cell) {
      const target = typeof name === 'number' ? this.stage.ends.via : this.stage.ends;
      if (String(target[name]) === String(cell)) return;
      target[name] = cell;
      this.stage.draw();
    }
    if (cell || !isDone) this.replan();
  }

  painted(indices, isDone) {
    this.stage.paint(indices);
    if (isDone) this.replan();
  }

  /** Change what is drawn on the map. */
  edit(change) {
    change(this.stage.edits);
    this.controls.showPlaces(this.stage.places());
    this.stage.renderBase();
    this.replan();
  }

  clearEdits() {
    this.stage.ends.via = [];
    this.edit((edits) => edits.clear());
  }

  /** Take an area that was outlined: a zone, or a place, which needs a name. */
  outlined(polygon, tool) {
    const kind = $('zone-cost').value;
    const word = tool === 'zone' && kind in KINDS ? KINDS[kind] : tool;
    const name = freeName(word, this.stage.edits.features);
    if (tool === 'place') this.bubbles.askName(polygon, name);
    else if (kind in KINDS)
      this.addFeature(polygon, { name, kind, width: Number($('zone-width').value) || 1 });
    else this.addFeature(polygon, { name, cost: Number(kind) });
  }

  addFeature(polygon, properties) {
    const feature = featureOf(this.stage.map, polygon, properties);
    this.edit((edits) => edits.setFeatures([...edits.features, feature]));
  }

  /** Offer what can be asked of the place that was pressed. */
  pressed(point) {
    this.board.hideHint();
    const [place] = this.stage.shapesAt(point).filter(({ cost }) => cost === undefined);
    if (place && !this.live) this.bubbles.showRoom(place.name, point);
    else this.bubbles.close();
  }

  /** Open a map that was dropped, and put the GeoJSON that was dropped onto the map. */
  async openFiles(files) {
    try {
      const { maps, features } = await readFiles(files);
      if (Object.keys(maps).length) await this.openDropped(await api.addMap(maps));
      const { edits } = this.stage;
      if (features.length) this.edit(() => edits.setFeatures([...edits.features, ...features]));
    } catch (error) {
      this.controls.showError(new api.ServerError(error.message, 'map'));
    }
  }

  async openDropped(id) {
    this.options.maps = (await api.options()).maps;
    this.controls.fill();
    Object.assign(this.settings, defaultSettings());
    await this.openMap(id);
  }

  changeVia(change) {
    this.stage.ends.via = change(this.stage.ends.via).slice(0, 100);
    this.stage.draw();
    this.replan();
  }

  settingChanged(name) {
    this.bubbles.close();
    markExample($('examples'), $('example-about'), null);
    if (name === 'source' && this.settings.source === 'reply' && !this.settings.reply) {
      this.settings.reply = suggestedReply(this.stage.main.path, this.stage.map);
      this.controls.show();
    }
    this.replan();
  }

  choosePair(step) {
    const { pairs } = this.stage.map;
    const now = this.pairIndex();
    const next = now < 0 ? 0 : (now + step + pairs.length) % pairs.length;
    this.stage.ends = {
      ...this.stage.ends,
      start: [...pairs[next].start],
      goal: [...pairs[next].goal],
    };
    this.stage.draw();
    this.replan();
  }

  pairIndex() {
    const { start, goal } = this.stage.ends;
    return this.stage.map.pairs.findIndex(
      (pair) => String([pair.start, pair.goal]) === String([start, goal]),
    );
  }

  showEditing() {
    const { pairs } = this.stage.map;
    const index = this.pairIndex();
    $('pairs').hidden = pairs.length === 0;
    $('pair-name').textContent =
      index < 0 ? 'your own start and goal' : `start and goal ${index + 1} of ${pairs.length}`;
    const { done, undone, features, isEdited } = this.stage.edits;
    $('undo').disabled = done.length === 0;
    $('redo').disabled = undone.length === 0;
    $('save').disabled = features.length === 0;
    $('clear').disabled = !isEdited && this.stage.ends.via.length === 0;
  }

  /** Say that a method counts lengths alone, where costs are drawn. */
  ignoresCosts(method) {
    const { edits, main } = this.stage;
    const isCostly = (cost) => cost > FREE && cost < WALL;
    const isGraded = edits.levels().some(isCostly) || main.shapes.some((one) => isCostly(one.cost));
    return isGraded && !COUNTS_COSTS.includes(method)
      ? `${text(method, 40)} counts lengths alone; guided and exact_astar count what is drawn as cost.`
      : '';
  }

  onKey(event) {
    if (event.key === 'Escape') this.bubbles.close();
    const isTyping =
      ['TEXTAREA', 'INPUT'].includes(event.target.tagName) && event.target.type !== 'range';
    if (
      isTyping ||
      this.live ||
      !(event.ctrlKey || event.metaKey) ||
      event.key.toLowerCase() !== 'z'
    )
      return;
    event.preventDefault();
    this.edit((edits) => (event.shiftKey ? edits.redo() : edits.undo()));
  }

  linkSoon() {
    clearTimeout(this.linkTimer);
    this.linkTimer = setTimeout(() => this.writeLink(), LINK_DELAY_MS);
  }

  /** Put the view into the address. Returns whether all of it fits. */
  writeLink() {
    const { fragment, fits } = toFragment({
      ...this.stage.ends,
      map: this.stage.map.id,
      settings: this.controls.linkSettings(),
      edits: this.stage.edits,
    });
    history.replaceState(null, '', `#${fragment}`);
    return fits;
  }

  copyLink() {
    const fits = this.writeLink();
    const isDropped = this.stage.map.id.startsWith('dropped/');
    copy(
      location.href,
      fits
        ? `The link is copied.${isDropped ? ' Whoever opens it has to drop the map first.' : ''}`
        : 'The link is copied without what is drawn and typed: it is too long for a link.',
    );
  }

  showMode(mode) {
    const isLive = mode === 'live';
    document.body.classList.toggle('live', isLive);
    clearTimeout(this.linkTimer);
    this.stage.ends = null;
    this.stage.map = null;
    if (!isLive) {
      this.live?.stop();
      this.live = null;
      $('report-block').hidden = true;
      this.openLink(fromFragment(location.hash) ?? fromFragment(EXAMPLES[0].view));
      return;
    }
    this.player.pause();
    this.board.hideHint();
    this.stage.clearCaption();
    this.live = new Live(this.stage);
    this.live.start();
  }
}

async function begin() {
  try {
    const options = await api.options();
    $('version').textContent = text(options.version, 20);
    if (!options.maps?.length)
      throw new Error('The server has no maps. Start it with one: llm-astar play --map FILE');
    const page = new Page(options);
    if (options.live) listenToModes((mode) => page.showMode(mode));
    if (options.live && !location.hash) document.querySelector('[data-mode="live"]').click();
    else await page.open();
  } catch (error) {
    showVerdict({
      tone: 'fail',
      head: 'The page cannot start.',
      rest: ` ${text(error.message, 400)}`,
    });
  }
}

begin();
