# Copyright 2026 The LLM-A* for ROS 2 contributors
# SPDX-License-Identifier: Apache-2.0

"""A specification as a search problem: blocked cells, prices, and automata over regions.

Strictly, what a `must` clause forbids is blocked. Where no path keeps them all, it has a price
instead, so that the path found violates least: first the `must` clauses, then the `should`
clauses, and of equal paths the cheapest is taken.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from itertools import combinations

import numpy as np
from numpy.typing import NDArray

from llm_astar_planner.costmap.raster import Cover
from llm_astar_planner.instructions.clauses.clause import MUST, Clause, Constraints
from llm_astar_planner.instructions.polygons import NoRegionError
from llm_astar_planner.instructions.region_finder import Mask, RegionCells, RegionFinder
from llm_astar_planner.instructions.route import Route
from llm_astar_planner.instructions.specification import Specification
from llm_astar_planner.lazy import ndimage
from llm_astar_planner.search.automata import Automaton, visits
from llm_astar_planner.search.product import ProductProblem

# What a cell of length in a forbidden cell costs more: so many cells of detour are made for it.
MUST_PRICE = 1e6
SHOULD_PRICE = 1e3
# Cells that a region only touches cost this share.
TOUCHED_SHARE = 0.01


@dataclass(frozen=True, eq=False)
class Demand:
    """What one clause asks; `problem` is why it cannot be demanded, None if it can."""

    clause: Clause
    ask: Constraints
    problem: str | None = None

    @property
    def is_must(self) -> bool:
        """Whether the clause is demanded strictly; one that is not certain never is."""
        return self.clause.strength == MUST and not self.clause.unsure

    @property
    def price(self) -> float:
        """What a cell of length costs more where the clause is broken."""
        return MUST_PRICE if self.is_must else SHOULD_PRICE


def demands_of(specification: Specification, route: Route) -> tuple[Demand, ...]:
    """Return what each clause asks of the cells, in the order of the clauses."""
    finder = RegionFinder(route)
    return tuple(demand_of(clause, finder) for clause in specification.clauses)


def demand_of(clause: Clause, finder: RegionFinder) -> Demand:
    """Return what one clause asks of the cells."""
    try:
        ask = clause.ask(finder)
    except NoRegionError as error:
        return Demand(clause, Constraints(), str(error))
    return Demand(
        clause, Constraints() if ask is None else ask, 'not understood' if ask is None else None
    )


@dataclass(frozen=True, eq=False)
class InstructedProblem:
    """A search problem for a specification.

    `closed`: the cells to block besides those of the costmap, bool [height, width], or None.
    `product`: the rest of the problem, None if a plain search on the cells left open solves it.
    """

    closed: Mask | None = None
    product: ProductProblem | None = None


class Enforcer:
    """Makes search problems of the demands of a specification on a route."""

    def __init__(self, demands: Sequence[Demand], route: Route) -> None:
        """Take the demands of `demands_of` and their route."""
        self.demands = [demand for demand in demands if demand.problem is None]
        self.route = route

    def strict(self, *, owes_wishes: bool = True) -> InstructedProblem | None:
        """Return the problem whose paths keep every `must` clause; None if there are none.

        What a clause forbids at the start or at the goal has a price even here. Unless it
        `owes_wishes`, what rules of a `should` ask to be done is left out.
        """
        closed = np.zeros(self.route.costmap.blocked.shape, dtype=np.bool_)
        priced = []
        for demand in self.demands:
            barred, rest = self.barred(demand)
            closed |= False if barred is None else barred
            priced += [] if rest is None else [(demand.price, rest)]
        reached = self.reached(~self.route.costmap.blocked & ~closed)
        # Visited on the way, as far as one can tell, or within reach.
        visits = [zone for demand in self.demands if demand.is_must for zone in demand.ask.visits]
        is_due = all(zone.driven.any() or (zone.cells & reached).any() for zone in visits)
        if not is_due or not self.is_end_reached(reached, self.goals):
            return None
        rules: list[Automaton] = []
        for demand in self.demands:
            price = math.inf if demand.is_must else demand.price
            made = [rule.automaton(price) for rule in demand.ask.rules]
            rules += made if demand.is_must or owes_wishes else map(without_duties, made)
        product = self.product(reached, self.goals, priced, rules)
        return InstructedProblem(closed if closed.any() else None, product)

    def relaxed(self, *, owes: bool = True) -> InstructedProblem:
        """Return the problem whose cheapest path violates the clauses least.

        Visits of which no cell can be reached are left out, and unless it `owes` them so is what
        rules ask to be done.
        """
        reached = self.reached(~self.route.costmap.blocked)
        goals = self.goals if self.is_end_reached(reached, self.goals) else None
        asks = [(demand.price, demand.ask) for demand in self.demands]
        priced = [(price, ask.forbidden) for price, ask in asks if ask.forbidden is not None]
        rules = [rule.automaton(price) for price, ask in asks for rule in ask.rules]
        owed = rules if owes else [without_duties(rule) for rule in rules]
        return InstructedProblem(product=self.product(reached, goals, priced, owed))

    @cached_property
    def goals(self) -> Mask | None:
        """The cells that clauses ask the path to end in, None without such a clause."""
        return next((d.ask.goals for d in self.demands if d.ask.goals is not None), None)

    def barred(self, demand: Demand) -> tuple[Mask | None, Cover | None]:
        """Return the cells that a demand closes, and those that have a price instead.

        These are all of them where start or goal is among them; of a distance, those that are as
        near to that end.
        """
        forbidden = demand.ask.forbidden
        if forbidden is None or not demand.is_must:
            return None, forbidden
        ends = [self.route.start, *([] if self.goals is not None else [self.route.goal])]
        inside = [(x, y) for x, y in ends if forbidden.touched[y, x]]
        if not inside:
            return forbidden.touched, None
        if not demand.ask.ends_within:
            return None, forbidden
        cells = demand.ask.ends_within / self.route.costmap.grid_map.resolution
        height, width = forbidden.touched.shape
        y, x = np.ogrid[:height, :width]
        near = np.any([np.hypot(x - ex, y - ey) <= cells for ex, ey in inside], axis=0)
        return forbidden.touched & ~near, Cover(*(part & near for part in forbidden))

    def reached(self, free: Mask) -> Mask:
        """Return the cells connected to the start, as the costmap's components are."""
        neighbours = np.ones((3, 3)) if self.route.costmap.config.corner_cutting else None
        labels, _ = ndimage.label(free, structure=neighbours)
        x, y = self.route.start
        connected: Mask = (labels == labels[y, x]) & free
        return connected

    def is_end_reached(self, reached: Mask, goals: Mask | None) -> bool:
        """Tell whether the goal is reached, or one of the goal cells."""
        x, y = self.route.goal
        return bool(reached[y, x] if goals is None else (goals & reached).any())

    def product(
        self,
        reached: Mask,
        goals: Mask | None,
        priced: Sequence[tuple[float, Cover]],
        rules: Sequence[Automaton],
    ) -> ProductProblem | None:
        """Return the problem of automata and prices, None where nothing but cells was closed."""
        zones: list[RegionCells] = []
        groups = []
        for demand in self.demands:
            visited = demand.ask.visits
            due = [one for one in visited if one.driven.any() or (one.cells & reached).any()]
            if due:
                groups.append(tuple(range(len(zones), len(zones) + len(due))))
                zones += due
        automata = [started(visits(tuple(groups)), zones)] if groups else []
        found = [rule for demand in self.demands for rule in demand.ask.rules]
        for rule, automaton in zip(found, rules):
            begun = started(automaton, rule.zones)
            numbers = tuple(len(zones) + number for number in begun.regions)
            automata.append(replace(begun, regions=numbers))
            zones += rule.zones
        price = price_of(priced)
        if not automata and goals is None and price is None:
            return None
        masks = tuple(zone.cells & reached for zone in zones)
        return ProductProblem(masks, tuple(automata), goals, price)


def without_duties(automaton: Automaton) -> Automaton:
    """Return an automaton that forbids or prices what it did, and accepts every path."""
    return replace(automaton, accepting=np.ones_like(automaton.accepting))


def started(automaton: Automaton, zones: Sequence[RegionCells]) -> Automaton:
    """Return an automaton as it is after the way driven: its states are numbered anew."""
    letters = np.zeros(len(zones[0].driven), dtype=np.int64)
    for bit, number in enumerate(automaton.regions):
        letters |= zones[number].driven.astype(np.int64) << bit
    state = 0
    for letter in letters[np.flatnonzero(np.diff(letters, prepend=-1))]:
        state = int(automaton.after[state, letter])
    order = np.arange(len(automaton.accepting))
    order[[0, state]] = state, 0
    price = None if automaton.price is None else automaton.price[order]
    after = order[automaton.after][order].astype(automaton.after.dtype)
    return replace(automaton, after=after, accepting=automaton.accepting[order], price=price)


def price_of(priced: Sequence[tuple[float, Cover]]) -> NDArray[np.float32] | None:
    """Return what each cell of length in forbidden cells costs more, None for nothing."""
    if not priced:
        return None
    total = np.zeros(priced[0][1].centres.shape, dtype=np.float32)
    for price, forbidden in priced:
        total[forbidden.touched] += price * TOUCHED_SHARE
        total[forbidden.centres] += price * (1.0 - TOUCHED_SHARE)
    return np.minimum(total, MUST_PRICE)


def contradictions(demands: Sequence[Demand]) -> tuple[tuple[Clause, Clause], ...]:
    """Return the pairs of `must` clauses that no path on any map can keep together.

    Found without a search: what one asks to visit lies wholly in what the other forbids, or the
    two leave no cell, or they end in different places.
    """
    musts = [demand for demand in demands if demand.is_must and demand.problem is None]
    return tuple(
        (one.clause, other.clause)
        for one, other in combinations(musts, 2)
        if excludes(one.ask, other.ask)
        or excludes(other.ask, one.ask)
        or leaves_nothing(one.ask, other.ask)
    )


def excludes(one: Constraints, other: Constraints) -> bool:
    """Tell whether one clause forbids all of a region that the other has to visit or end in."""
    if one.forbidden is None:
        has_goals = one.goals is not None and other.goals is not None
        return has_goals and not (one.goals & other.goals).any()  # type: ignore[operator]
    wanted = [zone.cells for zone in other.visits]
    wanted += [] if other.goals is None else [other.goals]
    return any(cells.any() and not (cells & ~one.forbidden.centres).any() for cells in wanted)


def leaves_nothing(one: Constraints, other: Constraints) -> bool:
    """Tell whether two clauses together forbid every cell, which neither does alone."""
    if one.forbidden is None or other.forbidden is None:
        return False
    first, second = one.forbidden.centres, other.forbidden.centres
    return bool((first | second).all() and not first.all() and not second.all())
