// A plan as the page shows it, of what the server sends: the names of `Plan.to_dict`.

import { number, objects, text } from './codec.js';

const MAX_WAYPOINTS = 1000;

/** Return a plan with its figures, waypoints and instruction in the words of the page. */
export function planOf(raw) {
  const seconds = (value) => (number(value) === null ? null : 1000 * value);
  return {
    ...raw,
    code: raw.code_name,
    waypoints: (Array.isArray(raw.waypoints) ? raw.waypoints : [])
      .slice(0, MAX_WAYPOINTS)
      .filter(Array.isArray)
      .map(([x, y, status], i) => ({ number: i + 1, x, y, status })),
    figures: {
      expansions: raw.operation,
      length: raw.length,
      length_m: raw.length_m,
      bound: raw.ratio,
      search_ms: seconds(raw.seconds_search),
      source_ms: seconds(raw.seconds_source),
      turns: raw.turns,
      clearance_m: raw.clearance,
    },
    instruction: raw.instruction_report ? instructionOf(raw.instruction_report) : null,
  };
}

/** Return what became of an instruction, clause by clause. */
function instructionOf(outcome) {
  const { questions, sentence, status, detail } = outcome.interpretation ?? {};
  const verdict = text(outcome.sentence);
  return {
    verdict,
    satisfied: outcome.satisfied === true,
    sentence,
    status,
    questions: (Array.isArray(questions) ? questions : []).map((question) => text(question)),
    clauses: objects(outcome.clauses, 300).map(clauseOf),
    note: [outcome.note, detail]
      .map((note) => text(note))
      .filter((note) => note && !verdict.includes(note))
      .join('; '),
  };
}

/** Return a clause with what was measured of it and what it costs. */
function clauseOf({ clause, status, detail, price }) {
  const costs = number(price) === null ? '' : `costs ${price.toFixed(1)} m`;
  return { clause, status, detail: [text(detail), costs].filter(Boolean).join(', ') };
}
