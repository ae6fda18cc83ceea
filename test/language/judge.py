"""The judge: whether what is claimed of a sentence is true, from its meaning and from the path.

The meaning of a sentence is a Truth: a formula about places, or clauses in JSON. A reading is held
against it on random traces, and a planned path by its points.
"""

import itertools
import json
import sys
from dataclasses import dataclass, field

import numpy as np
from language import ltlf
from language.semantics import Ground, Traces, keeps, keeps_one
from llm_astar_planner.instructions.interpretation import RouteInstruction
from llm_astar_planner.planning.compile import compile_instruction_kernels
from llm_astar_planner.planning.planner import Planner
from llm_astar_planner.planning.types import PlanRequest

TRACES, LONGEST = 320, 30
# What readings of a whole sentence say of themselves.
READ = ('understood', 'unsure')
AT_GOAL, ANYWHERE, FREE = 'at the goal', 'anywhere', 'free'
# Of a plan: time enough on a busy machine.
LIMITS = {'time_limit': 60.0, 'want_expanded': False}
NOT_ENFORCED = ('unknown', 'unsupported')
# Metres between the points of a planned path that are looked at.
STEP = 0.04


@dataclass(frozen=True)
class Truth:
    """What a sentence means: a formula whose atoms stand for regions, or clauses, or nothing.

    `says` is False where the sentence asks for something that no clause can say, so that no
    reading of it may be claimed.
    """

    formula: object = None
    regions: dict = field(default_factory=dict)
    clauses: tuple = ()
    says: bool = True

    def of(self, traces):
        """Tell which traces keep it: bool [n]."""
        if self.formula is None:
            return keeps(self.clauses, traces)
        letters = {name: traces.visits(region) for name, region in self.regions.items()}
        alive = traces.alive
        if {'X', 'N'} & set(str(self.formula)):
            letters, alive = without_repeats(letters, alive)
        return ltlf.holds(self.formula, letters, alive)

    def named_regions(self):
        """Return its regions in the order of mention."""
        if self.formula is None:
            return regions_of(self.clauses)
        return [self.regions[name] for name in ltlf.atoms(self.formula)]


def without_repeats(letters, alive):
    """Leave out positions where no letter holds or the same ones as before."""
    names = list(letters)
    stack = np.stack([letters[name] for name in names], axis=-1)
    result = np.zeros_like(stack)
    kept_alive = np.zeros_like(alive)
    for row in range(len(alive)):
        steps = stack[row][alive[row]]
        steps = steps[steps.any(axis=1)]
        is_new = np.ones(len(steps), dtype=bool)
        is_new[1:] = (steps[1:] != steps[:-1]).any(axis=1)
        steps = steps[is_new]
        result[row, : len(steps)] = steps
        kept_alive[row, : max(1, len(steps))] = True
    return {name: result[..., index] for index, name in enumerate(names)}, kept_alive


def regions_of(clauses):
    """Return the regions that clauses in JSON name, simple ones, in order and each once."""
    found = []
    for clause in clauses:
        for name in ('region', 'object', 'first', 'second', 'from'):
            if name in clause and clause[name] != 'walls':
                found += leaves(clause[name])
        for region in clause.get('regions', ()):
            found += leaves(region)
    return unique(found)


def leaves(region):
    """Return the simple regions that a region in JSON is made of."""
    if isinstance(region, str):
        return [{'place': region}]
    parts = region.get('any_of', region.get('all_of'))
    if parts is not None:
        return [leaf for part in parts for leaf in leaves(part)]
    if 'except' in region:
        return [leaf for part in (region['region'], *region['except']) for leaf in leaves(part)]
    return [region]


def unique(regions):
    """Return regions in order, each once."""
    return list({json.dumps(region, sort_keys=True): region for region in regions}.values())


# --- Readings


@dataclass(frozen=True)
class Reading:
    """What was read of a sentence: clauses in JSON, and how much of it was understood."""

    text: str
    clauses: tuple
    status: str
    interpretation: object = None

    @property
    def asks(self):
        """Whether a clause is unsure."""
        return any(is_unsure(clause) for clause in self.clauses)

    @property
    def enforced(self):
        """The clauses that ask something of a path."""
        return tuple(c for c in self.clauses if c['kind'] not in NOT_ENFORCED)

    @property
    def is_certain(self):
        """Whether all of it would be claimed of a path that keeps it."""
        is_plain = len(self.enforced) == len(self.clauses) > 0
        return self.status == 'understood' and is_plain and not self.asks

    def words(self):
        """Return the reading as one short line."""
        return ' + '.join(clause_words(clause) for clause in self.clauses) or self.status


def is_unsure(clause):
    """Tell whether a clause is a question."""
    return bool(clause.get('unsure') or clause.get('guessed'))


def clause_words(clause):
    """Return a clause as a few words."""
    rest = {k: v for k, v in clause.items() if k not in ('kind', 'strength', 'unsure', 'guessed')}
    text = json.dumps(rest, ensure_ascii=False).replace('"', '').replace('place: ', '')
    wish = '?' if is_unsure(clause) else ''
    should = ' (wish)' if clause.get('strength') == 'should' else ''
    return f'{clause["kind"]}{text}{should}{wish}'


def read(interpreter, text, places):
    """Return what an interpreter reads in a sentence."""
    found = interpreter.interpret(text, places, 2.0)
    clauses = tuple(found.specification.to_json()['clauses'])
    return Reading(text, clauses, found.status.value, found)


# --- Random traces


class Court:
    """A world with a start and a goal, where readings are held against truths."""

    def __init__(self, world, start=None, goal=None):
        self.world = world
        self.start = world.ends[0] if start is None else start
        self.goal = world.ends[1] if goal is None else goal
        self._grounds = {}

    def ground(self, regions):
        """Return the points of traces: the spots of the world, and those at named points."""
        extra = [self.start, self.goal]
        for region in regions:
            if 'point' in region:
                centre = np.array(region['point'], float)
                radius = region.get('radius') or 0.5
                extra += [centre, centre + (0.6 * radius, 0), centre + (0, radius + 0.4)]
        key = json.dumps([list(map(float, point)) for point in extra])
        if key not in self._grounds:
            points = np.concatenate((np.array(extra, float), self.world.spots))
            self._grounds[key] = Ground(self.world, points, self.start, self.goal)
        return self._grounds[key]

    def traces(self, truth, clauses, seed):
        """Return random traces near what the truth and a reading are about.

        A second half does with little changes what kept either of them in the first half. Half of
        the traces begin at the start and end at the goal, a quarter begin at the start.
        """
        orders = [truth.named_regions(), list(truth.regions.values()), regions_of(clauses)]
        regions = unique(itertools.chain(*orders))
        ground = self.ground(regions)
        draw = np.random.default_rng(seed)
        skeletons = [[regions.index(r) for r in unique(order)] for order in orders]
        skeletons += [visit_order(clauses, regions), visit_order(truth.clauses, regions)]
        first = [skeleton(draw, skeletons, len(regions), index) for index in range(TRACES)]
        steps, alive = drawn(draw, ground, regions, first)
        traces = Traces(ground, steps, alive, seed)
        good = np.flatnonzero(truth.of(traces) | keeps(clauses, traces))
        skeletons += [first[index] for index in good]
        second = [skeleton(draw, skeletons, len(regions), 3 + n % 5) for n in range(TRACES)]
        more_steps, more_alive = drawn(draw, ground, regions, second)
        steps, alive = np.concatenate((steps, more_steps)), np.concatenate((alive, more_alive))
        return Traces(ground, steps, alive, seed)


def drawn(draw, ground, regions, orders):
    """Return steps and alive of traces that go through regions, by their numbers, in turn."""
    pools = [np.flatnonzero(ground.inside(region, reach=True)) for region in regions]
    named = [ground.inside(region, reach=reach) for region in regions for reach in (False, True)]
    outside = ~np.any(named, axis=0) if named else np.ones(len(ground.points), dtype=bool)
    elsewhere = np.flatnonzero(outside) if outside.any() else np.arange(len(ground.points))
    steps = np.zeros((len(orders), LONGEST), dtype=int)
    alive = np.zeros((len(orders), LONGEST), dtype=bool)
    for index, order in enumerate(orders):
        row = []
        gaps = draw.random() * 1.3
        for step in order:
            if draw.random() < gaps:
                row.append(draw.choice(elsewhere))
            if len(pools[step]):
                row.append(draw.choice(pools[step]))
        if draw.random() < 0.5 or not row:
            row.append(draw.choice(elsewhere))
        if ending(index) != FREE:
            row = [0, *row, *([1] if ending(index) == AT_GOAL else [])]
        row = row[:LONGEST]
        steps[index, : len(row)] = row
        alive[index, : len(row)] = True
    return steps, alive


def ending(index):
    """Return where a trace ends: at the goal, anywhere, or anywhere without a start."""
    return (AT_GOAL, AT_GOAL, ANYWHERE, FREE)[index // 8 % 4]


def visit_order(clauses, regions):
    """Return the numbers of the regions that clauses visit, in their order, with repetitions."""
    order = []
    for clause in clauses:
        for region in clause.get('regions', ()):
            order.append(regions.index(leaves(region)[0]))
    return order


def skeleton(draw, skeletons, count, index):
    """Return the numbers of regions that a trace goes through."""
    if not count:
        return []
    kind = index % 8
    if kind == 0:
        return list(draw.permutation(count)[: draw.integers(0, 2 * count + 1)])
    if kind == 1:  # one again and again
        return [int(draw.integers(count))] * int(draw.integers(1, 7))
    if kind == 2:
        return list(draw.integers(0, count, draw.integers(0, 6)))
    order = list(skeletons[draw.integers(len(skeletons))])
    if kind == 3 and order:  # a part of it
        return order[: draw.integers(1, len(order) + 1)]
    for _ in range(draw.integers(0, 3) if kind > 3 else 0):
        change = draw.integers(4)
        at = int(draw.integers(len(order) + 1))
        if change == 0:
            order.insert(at, int(draw.integers(count)))
        elif order and change == 1:
            del order[at % len(order)]
        elif len(order) > 1 and change == 2:
            one = at % (len(order) - 1)
            order[one], order[one + 1] = order[one + 1], order[one]
        elif order:
            order.insert(at, order[at % len(order)])
    return order


SAME, STRONGER, WEAKER, CONTRADICTS, UNCLEAR = (
    'same', 'stronger', 'weaker', 'contradicts', 'unclear',
)  # fmt: skip


def relation(truth, clauses, court, seed=0):
    """Return how a reading stands to the truth on random traces."""
    try:
        traces = court.traces(truth, clauses, seed)
        true, read_as = truth.of(traces), keeps(clauses, traces)
    except (LookupError, NotImplementedError, ValueError):
        return UNCLEAR
    if not read_as.any():
        return UNCLEAR
    if not (true & read_as).any():
        return CONTRADICTS if true.any() else WEAKER
    if (read_as & ~true).any():
        return WEAKER
    return STRONGER if (true & ~read_as).any() else SAME


def clause_relation(truth, clause, court, seed=0):
    """Return CONTRADICTS where a clause breaks the truth, SAME where the truth asks for it.

    STRONGER: the sentence does not ask for it.
    """
    try:
        traces = court.traces(truth, (clause,), seed)
        true, read_as = truth.of(traces), keeps_one(clause, traces)
    except (LookupError, NotImplementedError, ValueError):
        return UNCLEAR
    if true.any() and not (true & read_as).any():
        return CONTRADICTS
    return STRONGER if (true & ~read_as).any() else SAME


def can_be_met(truth, court, tries=6):
    """Tell whether a trace from the start to the goal keeps the truth; it may say where to end."""
    wanted = {AT_GOAL, *(ANYWHERE for clause in truth.clauses if clause['kind'] == 'end_at')}
    fits = [ending(index % TRACES) in wanted for index in range(2 * TRACES)]
    return any(
        bool((truth.of(court.traces(truth, truth.clauses, seed)) & fits).any())
        for seed in range(tries)
    )


# --- Planned paths


class Driver:
    """Plans on a world with what was understood of a sentence."""

    def __init__(self, world):
        compile_instruction_kernels()  # else the first plans would run out of time
        self.world = world
        self.planner = Planner(world.grid_map).prepare()

    def plan(self, interpretation, start, goal):
        """Return the plan for an interpretation."""
        instruction = RouteInstruction(interpretation, self.world.places)
        cells = self.world.cell(start), self.world.cell(goal)
        request = PlanRequest(*cells, instruction=instruction, **LIMITS)
        return self.planner.plan(request)

    def trace(self, plan, start, goal):
        """Return the planned path as the one of Traces, looked at every few centimetres."""
        corners = np.atleast_2d(self.world.grid_map.grid_to_world(plan.path))
        at = np.concatenate(([0.0], np.cumsum(np.hypot(*np.diff(corners, axis=0).T))))
        places = np.linspace(0.0, at[-1], max(2, int(at[-1] / STEP)))
        points = np.column_stack([np.interp(places, at, corners[:, axis]) for axis in (0, 1)])
        ground = Ground(self.world, points, start, goal)
        steps = np.arange(len(points))[None]
        alive = np.ones((1, len(points)), dtype=bool)
        clearance = np.array([ground.wall_distance().min()])

        def passed(region, side):
            return np.array([passes(ground, region, side)])

        return Traces(ground, steps, alive, clearance=clearance, passed=passed)


def passes(ground, region, side):
    """Tell whether points cross the ray from the middle of a region to a side of the map."""
    centre = np.array(ground.shape(region).centroid.coords[0])
    ahead = ground.goal - ground.start
    ahead = ahead / max(1e-9, np.hypot(*ahead))
    towards = {
        'north': (0, 1), 'south': (0, -1), 'east': (1, 0), 'west': (-1, 0),
        'left': (-ahead[1], ahead[0]), 'right': (ahead[1], -ahead[0]),
    }[side]  # fmt: skip
    offset = ground.points - centre
    along = offset @ np.asarray(towards)
    across = towards[0] * offset[:, 1] - towards[1] * offset[:, 0]
    crossing = np.flatnonzero(np.diff(np.sign(across)) != 0)
    return bool((along[crossing] > 0).any() and not (along[crossing] < 0).any())


# --- Verdicts


@dataclass(frozen=True)
class Verdict:
    """What became of one sentence."""

    reading: Reading
    can_be_met: bool
    met: bool
    claimed: bool
    relation: str
    clause_claims: int = 0
    clause_false: tuple = ()
    clause_extra: int = 0

    @property
    def is_wrong(self):
        """Whether the whole was read for certain, with another meaning."""
        return self.reading.is_certain and self.relation in (WEAKER, CONTRADICTS)

    @property
    def is_false(self):
        """Whether something false is claimed of the whole."""
        return self.claimed and (self.relation in (WEAKER, CONTRADICTS) or not self.met)


# From the best to the worst; where a sentence has several meanings, the best one counts.
ORDER = (SAME, STRONGER, UNCLEAR, WEAKER, CONTRADICTS)


def best_relation(truths, clauses, court, seed=0):
    """Return how a reading stands to the meaning that suits it best; WEAKER where there is none.

    A sentence without a meaning that clauses can say has no reading that may be claimed.
    """
    found = [
        WEAKER if not truth.says and how == SAME else how
        for truth in truths
        for how in [relation(truth, clauses, court, seed)]
    ]
    return min(found, key=ORDER.index, default=WEAKER)


def best_clause_relation(truths, clause, court, seed=0):
    """Return how a clause stands to the meaning that suits it best; SAME where there is none."""
    found = [clause_relation(truth, clause, court, seed) for truth in truths]
    return min(found, key=ORDER.index, default=SAME)


def judge(interpreter, driver, text, truths, court, seed=0):
    """Read a sentence that means one of some truths, plan, and judge what is claimed."""
    reading = read(interpreter, text, court.world.places)
    plan = driver.plan(reading.interpretation, court.start, court.goal)
    met = False
    if len(plan.path):
        driven = driver.trace(plan, court.start, court.goal)
        met = any(bool(truth.of(driven)[0]) for truth in truths)
    outcome = plan.instruction
    kept = [
        clause
        for clause, one in zip(reading.clauses, outcome.clauses if outcome else ())
        if one.status.value == 'kept' and not is_unsure(clause)
    ]
    relations = [best_clause_relation(truths, clause, court, seed) for clause in kept]
    return Verdict(
        reading,
        any(truth.says and can_be_met(truth, court) for truth in truths),
        met,
        outcome is not None and outcome.satisfied is True,
        best_relation(truths, reading.enforced, court, seed) if reading.enforced else UNCLEAR,
        len(kept),
        tuple(c for c, how in zip(kept, relations) if how == CONTRADICTS),
        relations.count(STRONGER),
    )


COLUMNS = (
    'corpus', 'sentences', 'can be met', 'met', 'claimed', 'false', 'stronger', 'sure', 'wrong',
    'questions', 'partly', 'not understood', 'clause claims', 'false clauses',
    'clauses not asked for',
)  # fmt: skip


def unread(status):
    """Return how many sentences were read in part, and how many not at all."""
    partly = status.count('partly understood')
    return partly, len(status) - partly - sum(text in READ for text in status)


def row(name, verdicts):
    """Return one row of the table: counts of verdicts."""
    status = [verdict.reading.status for verdict in verdicts]
    return (
        name,
        len(verdicts),
        sum(v.can_be_met for v in verdicts),
        sum(v.can_be_met and v.met for v in verdicts),
        sum(v.claimed for v in verdicts),
        sum(v.is_false for v in verdicts),
        sum(v.claimed and not v.is_false and v.relation == STRONGER for v in verdicts),
        sum(v.reading.is_certain for v in verdicts),
        sum(v.is_wrong for v in verdicts),
        sum(v.reading.asks for v in verdicts),
        *unread(status),
        sum(v.clause_claims for v in verdicts),
        sum(len(v.clause_false) for v in verdicts),
        sum(v.clause_extra for v in verdicts),
    )


def table(rows, columns=COLUMNS):
    """Return rows as a table in Markdown."""
    lines = ['| ' + ' | '.join(map(str, line)) + ' |' for line in (columns, *rows)]
    lines.insert(1, '|' + '---|' * len(columns))
    return '\n'.join(lines)


def say(text):
    """Print a line for `pytest -s`."""
    sys.stdout.write(f'{text}\n')
