// The form: what to plan and how. Its values are the settings; errors stand beside the fields.

import { text } from './codec.js';
import { element } from './results.js';

const $ = (id) => document.getElementById(id);
const WITH_HEURISTIC = ['astar', 'weighted_astar', 'dynamic_weighted_astar', 'llm_astar'];
const WITH_WAYPOINTS = ['guided', 'llm_astar'];
const NUMBERS = ['weight', 'max_suboptimality', 'robot_radius', 'alternatives'];
const ON_STAGE = ['start', 'goal', 'walls', 'via'];
const MAX_CHIPS = 60;
// Of the robot on a robot map.
const RADIUS_M = 0.2;

export class Controls {
  /** `onChange(name)` is called after a change of a setting, `onMap(id)` for another map. */
  constructor(options, settings, onChange, onMap) {
    this.options = options;
    this.settings = settings;
    this.onChange = onChange;
    this.fill();
    $('map').addEventListener('change', () => onMap($('map').value));
    for (const name of [
      'method',
      'source',
      'heuristic',
      ...NUMBERS,
      'any_angle',
      'corner_cutting',
    ]) {
      $(name).addEventListener('change', () => this.changed(name));
    }
    for (const name of ['reply', 'instruction', 'why']) this.listenToText(name);
    $('drop-instruction').addEventListener('click', () => this.setText('instruction', ''));
    for (const form of ['ask', 'asking'])
      $(form).addEventListener('submit', (event) => event.preventDefault());
  }

  listenToText(name) {
    if (name !== 'why') $(name).maxLength = this.options.limits?.text ?? 4000;
    $(`use-${name}`).addEventListener('click', () => this.changed(name));
    $(name).addEventListener('keydown', (event) => {
      const isSent =
        event.key === 'Enter' && (event.ctrlKey || event.metaKey || name !== 'reply');
      if (!isSent || event.shiftKey) return;
      event.preventDefault();
      this.changed(name);
    });
  }

  fill() {
    const option = (value, name) => {
      const made = element('option', text(name, 100));
      made.value = text(value, 300);
      return made;
    };
    const nameOf = (name) => (name === 'reply' ? 'a typed reply' : name);
    $('map').replaceChildren(...this.options.maps.map((map) => option(map.id, map.name)));
    for (const name of ['method', 'source']) {
      $(name).replaceChildren(
        ...this.options[`${name}s`].map((item) => option(item.name, nameOf(text(item.name, 60)))),
      );
    }
    $('heuristic').replaceChildren(...this.options.heuristics.map((name) => option(name, name)));
    if (this.options.limits?.radius_m)
      $('robot_radius').max = String(this.options.limits.radius_m);
  }

  changed(name) {
    const input = $(name);
    if (input.type === 'checkbox') this.settings[name] = input.checked;
    else if (NUMBERS.includes(name)) this.settings[name] = Number(input.value.replace(',', '.'));
    else this.settings[name] = input.value;
    this.show();
    this.onChange(name);
  }

  setText(name, value) {
    $(name).value = value;
    this.changed(name);
  }

  /** Take a map: its description, its places, and whether corners are cut on it by default. */
  setMap(map) {
    this.map = map;
    for (const [name, value] of Object.entries(this.mapDefaults())) this.settings[name] ??= value;
    $('map').value = map.id;
    const size = map.isMetric
      ? `${(map.width * map.resolution).toFixed(1)} × ${(map.height * map.resolution).toFixed(1)} m, ${map.resolution} m a cell`
      : `${map.width} × ${map.height} cells`;
    $('map-about').textContent = size;
    const [xs, ys] = [map.width, map.height].map(
      (cells, axis) => `${map.offset[axis]} to ${cells - 1 + map.offset[axis]}`,
    );
    $('reply-about').textContent = `In cells: x ${xs}, y ${ys}. Ctrl+Enter plans with it.`;
    this.showPlaces(map.places);
    this.show();
  }

  /** List the names of places; one that is pressed is written into the instruction. */
  showPlaces(places) {
    $('instruction').placeholder = places.length
      ? `avoid the ${places[0].name}`
      : 'keep 2 m away from the walls';
    $('why').placeholder = places.length
      ? `why so long? why not through the ${places[0].name}?`
      : 'why so long?';
    $('places').replaceChildren(
      ...places.slice(0, MAX_CHIPS).map((place) => this.chip(place.name)),
    );
  }

  /** Add to the instruction that a place is to be driven through or avoided, and plan. */
  addClause(verb, name) {
    const before = this.settings.instruction.trim();
    this.setText('instruction', `${before ? `${before}, ` : ''}${verb} the ${name}`);
  }

  /** Return what fits the map where nothing else is asked: the paper's rules, or a small robot. */
  mapDefaults() {
    return this.map.isMetric
      ? { robot_radius: RADIUS_M, corner_cutting: false }
      : { robot_radius: 0, corner_cutting: true };
  }

  /** Return the settings for a link: null where they are those that fit the map. */
  linkSettings() {
    const usual = this.mapDefaults();
    return Object.fromEntries(
      Object.entries(this.settings).map(([name, value]) => [
        name,
        value === usual[name] ? null : value,
      ]),
    );
  }

  chip(name) {
    const button = element('button', name);
    button.type = 'button';
    button.addEventListener('click', () => {
      const field = $('instruction');
      field.value = `${field.value || 'go through'} ${field.value ? '' : 'the '}${name}`.replace(
        /\s+/g,
        ' ',
      );
      field.focus();
    });
    return button;
  }

  /** Show the settings in the form, and only the fields that the method looks at. */
  show() {
    for (const [name, value] of Object.entries(this.settings)) {
      if ($(name).type === 'checkbox') $(name).checked = Boolean(value);
      else if (document.activeElement !== $(name) || $(name).tagName === 'SELECT')
        $(name).value = String(value ?? '');
    }
    const { method, source } = this.settings;
    this.showRow('guided', method === 'guided');
    this.showRow('heuristic', WITH_HEURISTIC.includes(method));
    this.showRow('weight', method === 'weighted_astar');
    $('reply-row').hidden = source !== 'reply';
    $('method-about').textContent = this.aboutOf('methods', method);
    const isUsed = WITH_WAYPOINTS.includes(method);
    $('source-about').textContent = isUsed
      ? this.aboutOf('sources', source)
      : 'This method uses no waypoints.';
    $('source').disabled = !isUsed;
  }

  showRow(name, isShown) {
    document.querySelector(`[data-for="${name}"]`).hidden = !isShown;
  }

  aboutOf(kind, name) {
    const about = text(this.options[kind].find((item) => item.name === name)?.about, 200);
    return about.charAt(0).toUpperCase() + about.slice(1);
  }

  /** Write an error next to its field; with null, remove all. */
  showError(error) {
    for (const place of document.querySelectorAll('[data-error]')) place.hidden = true;
    for (const input of document.querySelectorAll('[aria-invalid]'))
      input.removeAttribute('aria-invalid');
    if (!error) return;
    const field = ON_STAGE.includes(error.field) ? 'stage' : error.field;
    const place =
      document.querySelector(`[data-error="${CSS.escape(field || 'stage')}"]`) ??
      document.querySelector('[data-error="stage"]');
    place.textContent = text(error.message, 600);
    place.hidden = false;
    if (error.field in this.settings) $(error.field).setAttribute('aria-invalid', 'true');
  }
}
