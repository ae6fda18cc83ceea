// Requests to the server that served the page.

import { text } from './codec.js';

/** Why the server refused a request: a sentence, and the field of the form that is at fault. */
export class ServerError extends Error {
  constructor(message, field = '') {
    super(text(message, 600));
    this.field = text(field, 40);
  }
}

const GONE =
  'The server does not answer. Is "llm-astar play" still running? Start it again and reload.';

async function fetched(path, options) {
  let response;
  try {
    response = await fetch(path, options);
  } catch {
    throw new ServerError(GONE);
  }
  const body = await response.json().catch(() => null);
  if (response.ok && body) return body;
  throw new ServerError(
    body?.error ?? `The server answered with HTTP ${response.status}.`,
    body?.field,
  );
}

/** Return what the server offers to choose from. */
export const options = () => fetched('api/options');

/** Return a map by its id. */
export const mapOf = (id) => fetched(`api/map?id=${encodeURIComponent(id)}`);

const posted = (path, value) =>
  fetched(path, {
    method: 'POST',
    headers: { 'Content-Type': 'application/json' },
    body: JSON.stringify(value),
  });

/** Add a map of files, {name: contents in base64}, and return its id. */
export const addMap = (files) => posted('api/map', files);

/** Return the plans for a request. */
export const plan = (request) => posted('api/plan', request);

/** Plans one request at a time; of those that come meanwhile only the newest is sent. */
export class PlanQueue {
  constructor(onPlans, onError) {
    this.onPlans = onPlans;
    this.onError = onError;
    this.next = null;
    this.busy = false;
  }

  async ask(request) {
    this.next = request;
    if (this.busy) return;
    this.busy = true;
    while (this.next) {
      const current = this.next;
      this.next = null;
      try {
        const reply = await plan(current);
        this.onPlans(reply, current, this.next === null);
      } catch (error) {
        if (this.next === null) this.onError(error, current);
      }
    }
    this.busy = false;
  }
}
