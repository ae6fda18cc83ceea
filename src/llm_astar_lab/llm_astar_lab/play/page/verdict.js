// Says in a plain sentence which plan won, and at what price.

import { number, shown, text } from './codec.js';

/** Return how many per cent less `value` is than `other`, in words. */
function fewer(value, other) {
  const part = 100 * (1 - value / other);
  if (part >= 99.5) return `${shown(other / value)} times fewer`;
  return `${shown(part, part < 10 ? 1 : 0)}% fewer`;
}

/** Return the path of a plan beside another's: 'a path 2.1% longer', or '' where unknown. */
function pathBeside(plan, other) {
  const [own, its] = [plan.figures?.length, other.figures?.length].map(number);
  if (own === null || its === null) return '';
  const part = 100 * (own / its - 1);
  if (Math.abs(part) < 0.05) return 'an equally long path';
  return `a path ${shown(Math.abs(part), 1)}% ${part > 0 ? 'longer' : 'shorter'}`;
}

/** Return the length of a plan's path in words. */
function lengthOf({ figures: { length, length_m: metres } = {} }, isMetric) {
  return isMetric ? `${shown(metres, 1)} m` : `${shown(length, 1)} cells`;
}

/** Return in words how good a path is proven to be, '' where it is not. */
function proof({ figures: { bound } = {} }) {
  const factor = number(bound);
  if (factor === null) return '';
  return factor < 1.0005
    ? ', proven the cheapest'
    : `, proven at most ${shown(100 * (factor - 1), 1)}% over the cheapest`;
}

const expansionsOf = (plan) => number(plan.figures?.expansions) ?? 0;

function byWaypoints(chosen, plain) {
  const [own, its] = [expansionsOf(chosen), expansionsOf(plain)];
  const sent = (chosen.waypoints ?? []).length;
  const used = (chosen.waypoints ?? []).filter((point) => point.status === 'accepted').length;
  const path = pathBeside(chosen, plain);
  const found = path ? `, and ${path}` : '';
  if (!used) {
    const head = sent ? 'No waypoint could be used:' : 'The source gave no waypoints:';
    return { tone: 'draw', head, rest: ` the search did without, ${shown(own)} expansions.` };
  }
  if (own < its)
    return {
      tone: 'win',
      head: 'The waypoints win:',
      rest: ` ${shown(own)} expansions instead of ${shown(its)} (${fewer(own, its)})${found}.`,
    };
  if (own > its)
    return {
      tone: 'lose',
      head: 'The search without waypoints wins:',
      rest: ` ${shown(its)} expansions instead of ${shown(own)}${path ? `; the waypoints led to ${path}` : ''}.`,
    };
  return {
    tone: 'draw',
    head: 'A draw:',
    rest: ` ${shown(own)} expansions with waypoints and without.`,
  };
}

function byAstar(chosen, astar) {
  const [own, its] = [expansionsOf(chosen), expansionsOf(astar)];
  const name = text(chosen.title, 60).split(',')[0];
  const path = pathBeside(chosen, astar);
  const found = path ? `, and ${path}` : '';
  if (own < its)
    return {
      tone: 'win',
      head: `${name} beats A*:`,
      rest: ` ${shown(own)} expansions instead of ${shown(its)} (${fewer(own, its)})${found}.`,
    };
  if (own > its)
    return {
      tone: 'lose',
      head: `A* beats ${name}:`,
      rest: ` ${shown(its)} expansions instead of ${shown(own)}; ${name} found ${path || 'a path'}.`,
    };
  return { tone: 'draw', head: 'A draw with A*:', rest: ` ${shown(own)} expansions each.` };
}

function byInstruction(chosen, other) {
  const { clauses = [], questions = [], satisfied, verdict } = chosen.instruction;
  const path = other ? pathBeside(chosen, other) : '';
  const beside = path && `on ${path} than without it`.replace('long path than', 'long path as');
  const isBroken = clauses.some(({ status }) => ['not kept', 'impossible'].includes(status));
  if (questions.length && !isBroken)
    return {
      tone: 'lose',
      head: 'A question first:',
      rest: ` the path${path ? `, ${path.replace('a path ', '')} than without it,` : ''} is that of the reading below.`,
    };
  // What follows the first sign says why it is not kept; a question stands below.
  const said = text(verdict, 2000).replace(`: ${questions[0]}`, '');
  const [head, why = ''] = said.split(/(?<=[:;]) (.*)/s);
  const parts = isBroken ? [why] : [why, beside];
  return {
    tone: satisfied === true ? 'win' : isBroken ? 'fail' : 'lose',
    head: why || !path || isBroken ? head : `${head},`,
    rest: `${parts
      .filter(Boolean)
      .map((part) => ` ${part}`)
      .join(';')}.`,
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

/**
 * Return the verdict on plans: {tone, head, rest}; tone is win, lose, draw or fail. `isMetric` says
 * whether the map counts in metres.
 */
export function verdictOf(plans, isMetric = false) {
  const chosen = plans.find((plan) => plan.role === 'chosen');
  const [plain, astar] = ['no_waypoints', 'astar'].map((role) =>
    plans.find((plan) => plan.role === role && plan.found),
  );
  if (!chosen?.found) return failure(chosen ?? {}, plans);
  const other = plain ?? astar;
  if (chosen.instruction)
    return byInstruction(
      chosen,
      plans.find((plan) => plan.found && !plan.instruction),
    );
  const length = `${lengthOf(chosen, isMetric)}${proof(chosen)}`;
  if (!other) return { tone: 'win', head: 'Path found:', rest: ` ${length}.` };
  const { tone, head, rest } = plain ? byWaypoints(chosen, plain) : byAstar(chosen, astar);
  const path = plain && astar ? pathBeside(astar, chosen) : '';
  const last = path ? ` A* expands ${shown(expansionsOf(astar))} for ${path}.` : '';
  return { tone, head: 'Path found:', rest: ` ${length}. ${head}${rest}${last}` };
}
