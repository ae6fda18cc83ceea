// Says in a plain sentence which plan won, and at what price.

import { number, shown, text } from './codec.js';

/** Return how many per cent less `value` is than `other`, in words. */
function fewer(value, other) {
  const part = 100 * (1 - value / other);
  if (part >= 99.5) return `${shown(other / value)} times fewer`;
  return `${shown(part, part < 10 ? 1 : 0)} % fewer`;
}

/** Say how long a path is beside another: '2.1 % longer', 'equally long', or nothing. */
function lengthBeside(plan, other) {
  const [own, its] = [plan.figures?.length, other.figures?.length].map(number);
  if (own === null || its === null) return '';
  const part = 100 * (own / its - 1);
  if (Math.abs(part) < 0.05) return 'equally long';
  return `${shown(Math.abs(part), 1)} % ${part > 0 ? 'longer' : 'shorter'}`;
}

function byWaypoints(chosen, plain) {
  const [own, its] = [chosen, plain].map((plan) => number(plan.figures?.expansions) ?? 0);
  const accepted = (chosen.waypoints ?? []).filter((point) => point.status === 'accepted').length;
  if (!accepted) return { tone: 'draw', head: 'No usable waypoints.', rest: ` The search did without: ${shown(own)} expansions.` };
  const rest = `${shown(own)} expansions instead of ${shown(its)}`;
  if (own < its) return { tone: 'win', head: 'The waypoints win:', rest: ` ${rest}, ${fewer(own, its)}.` };
  if (own > its) return { tone: 'lose', head: 'No waypoints wins:', rest: ` ${shown(its)} expansions; following the waypoints took ${shown(own)}.` };
  return { tone: 'draw', head: 'A draw:', rest: ` ${shown(own)} expansions with and without waypoints.` };
}

function byAstar(chosen, astar) {
  const [own, its] = [chosen, astar].map((plan) => number(plan.figures?.expansions) ?? 0);
  const rest = ` ${shown(own)} expansions, A* ${shown(its)}`;
  if (own < its) return { tone: 'win', head: `${text(chosen.title, 60)} beats A*:`, rest: `${rest}, so ${fewer(own, its)}.` };
  if (own > its) return { tone: 'lose', head: 'A* expands less:', rest: ` ${shown(its)} cells; ${text(chosen.title, 60)} took ${shown(own)}.` };
  return { tone: 'draw', head: 'A draw with A*:', rest: ` ${shown(own)} expansions each.` };
}

function byInstruction(chosen, other) {
  const { clauses = [], status } = chosen.instruction;
  const kept = clauses.filter((clause) => clause.status === 'satisfied').length;
  if (!clauses.length) return { tone: 'lose', head: 'The instruction was not used:', rest: ` ${text(status, 100)}.` };
  const isKept = kept === clauses.length;
  const length = other ? lengthBeside(chosen, other) : '';
  return {
    tone: isKept ? 'win' : 'lose',
    head: isKept ? 'The instruction is kept:' : 'The instruction is kept in part:',
    rest: ` ${kept} of ${clauses.length} ${clauses.length === 1 ? 'clause' : 'clauses'} satisfied${length ? `, on a path ${length} than without it`.replace('long than', 'long as') : ''}.`,
  };
}

function failure(chosen, plans) {
  const other = plans.find((plan) => plan !== chosen && plan.found);
  const code = text(chosen.code, 40);
  return {
    tone: 'fail',
    head: 'No path:',
    rest: ` ${text(chosen.message, 400)}${code ? ` [${code}]` : ''}.${other ? ` ${text(other.title, 60)} finds one.` : ''}`,
  };
}

/** Return the verdict on plans: {tone, head, rest}; tone is win, lose, draw or fail. */
export function verdictOf(plans) {
  const chosen = plans.find((plan) => plan.role === 'chosen');
  const [plain, astar] = ['no_waypoints', 'astar'].map((role) => plans.find((plan) => plan.role === role && plan.found));
  if (!chosen?.found) return failure(chosen ?? {}, plans);
  const other = plain ?? astar;
  if (chosen.instruction) return byInstruction(chosen, other);
  if (!other) return { tone: 'draw', head: 'Path found:', rest: ` ${shown(chosen.figures?.expansions)} expansions.` };
  const verdict = plain ? byWaypoints(chosen, plain) : byAstar(chosen, astar);
  const length = lengthBeside(chosen, other);
  if (length) verdict.rest += length === 'equally long' ? ' The paths are equally long.' : ` Its path is ${length}.`;
  if (plain && astar) verdict.rest += ` A* takes ${shown(astar.figures?.expansions)}.`;
  return verdict;
}
