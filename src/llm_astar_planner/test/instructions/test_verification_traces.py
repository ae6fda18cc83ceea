"""Clauses about order and number, against formulas of LTLf that are evaluated by their definition.

A random path becomes a finite trace: at each of its samples a set of propositions, "in the
region", "as deep in it as a visit", "no farther away than one and a half cells". A clause becomes
a formula over them, and a formula holds at a position of the trace by the quantifiers of its
textbook definition (De Giacomo and Vardi, 2013). Paths that only graze a border, where samples
and segments may differ, are left out.
"""

import math
from functools import reduce
from itertools import permutations, product

import numpy as np
import pytest
from llm_astar_planner.instructions.clauses.before import Before
from llm_astar_planner.instructions.clauses.count import Count
from llm_astar_planner.instructions.clauses.never_after import NeverAfter
from llm_astar_planner.instructions.clauses.then import Then
from llm_astar_planner.instructions.clauses.visit import Visit
from llm_astar_planner.instructions.regions import AnyOf, Box, Disc
from llm_astar_planner.instructions.specification import Specification
from llm_astar_planner.instructions.verification.verify import verify
from path_samples import STEP, box_depth, dense, disc_depth
from verified_maps import SATISFIED, field, route

COSTMAP = field()
LEFT = 1.5 * 0.5


# Formulas: a proposition is (region, depth), as far below 0 as away from the region.


def holds(formula, trace, at=0):
    """Whether a formula holds at a position of a finite trace of sets of propositions."""
    match formula:
        case 'prop', name:
            return name in trace[at]
        case 'not', inner:
            return not holds(inner, trace, at)
        case 'and', one, other:
            return holds(one, trace, at) and holds(other, trace, at)
        case 'or', one, other:
            return holds(one, trace, at) or holds(other, trace, at)
        case 'until', one, other:
            return any(
                holds(other, trace, then) and all(holds(one, trace, k) for k in range(at, then))
                for then in range(at, len(trace))
            )
        case 'finally', inner:
            return any(holds(inner, trace, then) for then in range(at, len(trace)))
        case 'globally', inner:
            return all(holds(inner, trace, then) for then in range(at, len(trace)))
    raise TypeError(formula)


def implies(one, other):
    """One implies another."""
    return 'or', ('not', one), other


def any_of(formulas):
    """One of several holds."""
    return reduce(lambda one, other: ('or', one, other), formulas)


def in_order(formulas):
    """One, then or at once the next, and so on."""
    *others, last = formulas
    return reduce(lambda later, one: ('finally', ('and', one, later)), others[::-1],
                  ('finally', last))  # fmt: skip


class Named:
    """A region with its propositions; AnyOf has those of its parts."""

    def __init__(self, region):
        self.region = region
        self.parts = [Named(one) for one in region.regions] if isinstance(region, AnyOf) else []
        self.inside, self.visited, self.near = (self.proposition(at) for at in range(3))

    def proposition(self, number):
        """Whether a sample is inside, as deep as a visit, or no farther than LEFT."""
        if self.parts:
            return any_of(part.proposition(number) for part in self.parts)
        return 'prop', (self.region, (0.0, self.visit_depth, -LEFT)[number])

    @property
    def visit_depth(self):
        """How deep a visit goes into a box; a disc is visited at its edge."""
        if isinstance(self.region, Disc):
            return 0.0
        width = min(self.region.x1 - self.region.x0, self.region.y1 - self.region.y0)
        return min(0.5, width / 4)


def formula_of(kind, regions, numbers):
    """The formula of a clause, or of several visit clauses, each a group of regions."""
    if kind == 'visits':
        orders = product(*(permutations(group) for group in regions))
        return any_of(
            in_order([one.visited for group in order for one in group]) for order in orders
        )
    first, second = regions
    if kind == 'before':
        no_entry = ('not', second.inside)
        return 'or', ('globally', no_entry), ('until', no_entry, first.visited)
    if kind == 'then':
        return 'globally', implies(first.inside, ('finally', second.visited))
    if kind == 'never_after':
        return 'globally', implies(first.inside, ('globally', ('not', second.inside)))
    at_least, at_most = numbers
    enough = entries(first, at_least)
    return ('and', enough, ('not', entries(first, at_most + 1))) if at_most is not None else enough


def entries(region, times):
    """A region is entered so many times: visited, and between two visits it was left."""
    if times == 0:
        return 'or', region.near, ('not', region.near)
    steps = [region.visited, ('not', region.near)] * times
    return in_order(steps[:-1])


def clauses_of(kind, regions, numbers):
    """The clauses that say the same."""
    if kind == 'visits':
        return [Visit(regions=tuple(one.region for one in group)) for group in regions]
    first, second = (one.region for one in regions)
    if kind == 'count':
        return [Count(region=first, at_least=numbers[0], at_most=numbers[1])]
    kinds = {'before': Before, 'then': Then, 'never_after': NeverAfter}
    return [kinds[kind](first=first, second=second)]


def drawn_region(random, nested=False):
    """A box or a disc on the map, or one of two."""
    form = random.integers(2 if nested else 5)
    if form == 4:
        return AnyOf((drawn_region(random, True), drawn_region(random, True)))
    x, y = (float(value) for value in random.uniform(2.0, 14.0, 2))
    if form % 2:
        return Disc(x, y, float(random.uniform(0.75, 3.0)))
    width, height = (float(value) for value in random.uniform(1.0, 5.0, 2))
    return Box(x, y, x + width, y + height)


def propositions(formula):
    """The propositions of a formula."""
    if formula[0] == 'prop':
        return {formula[1]}
    return set().union(*(propositions(part) for part in formula[1:]))


def trace_of(points, formula):
    """The trace of a path, without repetitions; None if it only grazes a border.

    A path grazes it where a sample is so near to it that the path may cross it between two
    samples, or crosses two borders between the same two.
    """
    xy, _ = dense(points)
    found, changes = {}, np.zeros(len(xy) - 1, dtype=int)
    for region, depth in propositions(formula):
        deep = depth_in(region, xy) - depth
        inside = deep > 0.0
        crossed = inside[1:] != inside[:-1]
        changes += crossed
        near = np.abs(deep) <= STEP
        beside = np.concatenate(([False], crossed)) | np.concatenate((crossed, [False]))
        if (near & ~beside).any() or near[0] or near[-1]:
            return None
        found[region, depth] = inside
    if (changes > 1).any():
        return None
    kept = np.concatenate(([0], np.flatnonzero(changes) + 1))
    return [{name for name, inside in found.items() if inside[at]} for at in kept]


def depth_in(region, xy):
    """How deep points lie in a region, the distance to it below 0 outside of it."""
    if isinstance(region, Disc):
        return disc_depth(xy, region.x, region.y, region.radius)
    return box_depth(xy, region.x0, region.y0, region.x1, region.y1)


def drawn(random):
    """A kind, its formula, its clauses, and a path."""
    kind = random.choice(['visits', 'before', 'then', 'never_after', 'count'])
    if kind == 'visits':
        regions = [
            [Named(drawn_region(random)) for _ in range(random.integers(1, 3))]
            for _ in range(random.integers(1, 4))
        ]
    else:
        regions = [Named(drawn_region(random)) for _ in range(2)]
    at_least = int(random.integers(3))
    at_most = None if random.integers(2) else at_least + int(random.integers(3))
    points = random.uniform(1.0, 19.0, (random.integers(2, 9), 2))
    numbers = at_least, at_most
    return formula_of(kind, regions, numbers), clauses_of(kind, regions, numbers), points


def compare(seed, count):
    """Compare so many random paths; return how many of them are kept."""
    random, compared, kept = np.random.default_rng(seed), 0, 0
    while compared < count:
        formula, clauses, points = drawn(random)
        trace = trace_of(points, formula)
        if trace is None:
            continue
        compared += 1
        wanted = holds(formula, trace)
        driven = int(random.integers(len(points)))
        way = route(COSTMAP, points[driven:], (), points[:driven])
        found = verify(Specification(tuple(clauses)), points[driven:], way, -math.inf)
        is_kept = all(one.status is SATISFIED for one in found)
        assert is_kept is wanted, (seed, compared, clauses, points.tolist(), driven, found)
        kept += wanted
    return kept


@pytest.mark.parametrize('seed', range(3))
def test_a_clause_is_kept_where_its_formula_holds(seed):
    assert 0.2 * 700 < compare(seed, 700) < 0.8 * 700


@pytest.mark.slow
@pytest.mark.parametrize('seed', range(100, 200))
def test_a_hundred_thousand_clauses_are_kept_where_their_formulas_hold(seed):
    assert 200 < compare(seed, 1000) < 800
