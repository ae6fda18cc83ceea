"""A specification as a search problem: blocked cells, prices, visits in order.

Strictly, what a `must` clause forbids is blocked. Where no path keeps them all, it has a price
instead, so that the path found violates least: first the `must` clauses, then the `should`
clauses, and of equal paths the cheapest is taken.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from llm_astar_msgs_adapter.maps.places import Place, Places
from numpy.typing import NDArray

from llm_astar_planner.costmap.costmap import Costmap
from llm_astar_planner.costmap.raster import Cover, cover, open_border
from llm_astar_planner.instructions import specification as spec
from llm_astar_planner.instructions.polygons import (
    RegionError,
    entered_polygon,
    grown,
    map_polygon,
    ray,
    region_polygon,
    visit_polygon,
)
from llm_astar_planner.instructions.route import PlaceGoalError, Route
from llm_astar_planner.lazy import ndimage
from llm_astar_planner.search import automata
from llm_astar_planner.search.product import ProductProblem
from llm_astar_planner.search.result import Cell

# What a cell of length in a forbidden cell costs more: so many cells of detour are made for it.
MUST_PRICE = 1e6
SHOULD_PRICE = 1e3
# Cells that a region only touches cost this share.
TOUCHED_SHARE = 0.01
# Half the width, in cells, of the strip that a ray blocks: no move gets past it between cells.
RAY_WIDTH = 0.3

ROUNDING = 1e-9

Mask = NDArray[np.bool_]


@dataclass(frozen=True, eq=False)
class Demand:
    """What one clause asks of the cells of a path; masks are bool [height, width].

    - `forbidden`: cells that no move may begin or end in; None for none.
    - `visits`: cells of each region to visit.
    - `visits_in_order`: whether they come after those of the clauses before.
    - `before`: cells to visit first, and cells that are forbidden until then.
    - `goals`: cells to end in.
    - `problem`: why the clause cannot be demanded, None if it can.
    """

    clause: spec.Clause
    forbidden: Cover | None = None
    visits: tuple[Mask, ...] = ()
    visits_in_order: bool = True
    before: tuple[Mask, Cover] | None = None
    goals: Mask | None = None
    problem: str | None = None

    @property
    def is_must(self) -> bool:
        """Whether the clause is demanded strictly; a guessed one never is."""
        return self.clause.strength == spec.MUST and not self.clause.guessed


def demands_of(specification: spec.Specification, route: Route) -> tuple[Demand, ...]:
    """Return what each clause asks of the cells, in the order of the clauses."""
    return tuple(
        demand_of(number, clause, route) for number, clause in enumerate(specification.clauses)
    )


def demand_of(number: int, clause: spec.Clause, route: Route) -> Demand:
    """Return what one clause, the `number`th, asks of the cells."""
    try:
        return DEMANDS[type(clause)](number, clause, route)
    except RegionError as error:
        return Demand(clause, problem=str(error))


def avoid(_: int, clause: spec.Avoid, route: Route) -> Demand:
    """Forbid the region and its margin."""
    if isinstance(clause.region, spec.Along) and clause.region.place == spec.WALLS:
        return Demand(clause, near_walls(clause.region.width + clause.margin, route))
    polygon = region_polygon(clause.region, route, spec.AVOID_RADIUS)
    if clause.margin:
        polygon = grown(polygon, clause.margin)
    grid_map = route.costmap.grid_map
    return Demand(clause, open_border(cover(polygon, grid_map), polygon, grid_map))


def visit(number: int, clause: spec.Visit, route: Route) -> Demand:
    """Visit the regions that were not visited on the way yet."""
    regions = [
        visit_cells(region, route)
        for part, region in enumerate(clause.regions)
        if (number, part) not in route.visited
    ]
    return Demand(clause, visits=tuple(regions))


def before(number: int, clause: spec.Before, route: Route) -> Demand:
    """Forbid the second region until the first one was visited, on the way or on this path."""
    if (number, 0) in route.visited:
        return Demand(clause)
    later = cover(entered_polygon(clause.second, route), route.costmap.grid_map)
    return Demand(clause, before=(visit_cells(clause.first, route), later))


def stay_in(_: int, clause: spec.StayIn, route: Route) -> Demand:
    """Forbid what lies outside of the region."""
    if isinstance(clause.region, spec.Along) and clause.region.place == spec.WALLS:
        return Demand(clause, near_walls(clause.region.width, route).outside())
    polygon = region_polygon(clause.region, route, spec.VISIT_RADIUS)
    grid_map = route.costmap.grid_map
    outside = cover(polygon, grid_map).outside()
    return Demand(clause, open_border(outside, map_polygon(route).difference(polygon), grid_map))


def pass_by(number: int, clause: spec.Pass, route: Route) -> Demand:
    """Forbid the object and the ray to the wrong side; cross the ray to the right side.

    A robot that has crossed that ray on the way does not have to do so again.
    """
    grid_map = route.costmap.grid_map
    width = RAY_WIDTH * grid_map.resolution
    body = cover(region_polygon(clause.region, route, spec.VISIT_RADIUS), grid_map)
    wrong = cover(ray(clause.region, clause.side, route, opposite=True).buffer(width), grid_map)
    right = cover(ray(clause.region, clause.side, route).buffer(width), grid_map)
    forbidden = Cover(*(cells | wrong.touched for cells in body))
    crossing = right.touched & ~forbidden.touched
    visits = () if (number, 0) in route.visited else (crossing,)
    return Demand(clause, forbidden, visits=visits, visits_in_order=False)


def keep_distance(_: int, clause: spec.KeepDistance, route: Route) -> Demand:
    """Forbid what is too near to the walls or the region."""
    if clause.region is None:
        return Demand(clause, near_walls(clause.metres, route))
    return avoid(
        0, spec.Avoid(clause.strength, clause.guessed, clause.region, clause.metres), route
    )


def end_at(_: int, clause: spec.EndAt, route: Route) -> Demand:
    """End in the region."""
    return Demand(clause, goals=visit_cells(clause.region, route))


def nothing(_: int, clause: spec.Clause, route: Route) -> Demand:  # noqa: ARG001 - as the others
    """Ask for nothing: the clause was not understood."""
    return Demand(clause, problem='not understood')


DEMANDS: dict[type[spec.Clause], Callable[..., Demand]] = {
    spec.Avoid: avoid,
    spec.Visit: visit,
    spec.Before: before,
    spec.StayIn: stay_in,
    spec.Pass: pass_by,
    spec.KeepDistance: keep_distance,
    spec.EndAt: end_at,
    spec.Unknown: nothing,
}


def visit_cells(region: spec.Region, route: Route) -> Mask:
    """Return the free cells in which a region counts as visited, bool [height, width]."""
    costmap = route.costmap
    polygon = visit_polygon(region, route)
    cells = cover(polygon, costmap.grid_map).centres
    if isinstance(region, spec.Disc):
        column, row = costmap.grid_map.world_to_cell(region.x, region.y)
        if costmap.grid_map.contains((column, row)):
            cells[row, column] = True
    if not cells.any():  # too small for the cells: those that it touches
        cells = cover(polygon, costmap.grid_map).touched
    free: Mask = cells & ~costmap.blocked
    return free


def near_walls(metres: float, route: Route) -> Cover:
    """Return the cells nearer to an occupied cell than so many metres.

    The distance is to the square of the occupied cell. `touched` has also the cells from which a
    move may come nearer than its two ends are.
    """
    grid_map, config = route.costmap.grid_map, route.costmap.config
    lethal = grid_map.cells >= config.occupied_threshold
    if not lethal.any():
        none = np.zeros(lethal.shape, dtype=np.bool_)
        return Cover(none, none, none)
    rows, columns = ndimage.distance_transform_edt(
        ~lethal, return_distances=False, return_indices=True
    )
    y, x = np.ogrid[: grid_map.height, : grid_map.width]
    beside = np.maximum(np.abs(columns - x) - 0.5, 0.0)
    above = np.maximum(np.abs(rows - y) - 0.5, 0.0)
    squared = beside**2 + above**2
    cells = metres / grid_map.resolution
    # Half a diagonal move is sqrt(1/2) long, so a move dips to sqrt(d^2 - 1/2) between its ends.
    too_near = squared < cells**2 - ROUNDING
    return Cover(too_near, too_near, squared < cells**2 + 0.5 - ROUNDING)


@dataclass(frozen=True, eq=False)
class Enforced:
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
        self.demands = demands
        self.route = route

    def strict(self) -> Enforced | None:
        """Return the problem whose paths keep every `must` clause; None if there are none.

        What a clause forbids at the start or at the goal has a price even here.
        """
        closed = np.zeros(self.route.costmap.blocked.shape, dtype=np.bool_)
        for demand in self.demands:
            if self.is_blocking(demand) and demand.forbidden is not None:
                closed |= demand.forbidden.touched
        return self.problem(closed if closed.any() else None, is_strict=True)

    def relaxed(self) -> Enforced:
        """Return the problem whose cheapest path violates the clauses least.

        Visits of which no cell can be reached are left out.
        """
        problem = self.problem(None, is_strict=False)
        return problem or Enforced()

    def is_blocking(self, demand: Demand) -> bool:
        """Tell whether what a demand forbids can be blocked: it is not at the start or goal."""
        if demand.forbidden is None or not demand.is_must:
            return False
        ends = [self.route.start]
        if self.goals() is None:
            ends.append(self.route.goal)
        return not any(demand.forbidden.touched[y, x] for x, y in ends)

    def goals(self) -> Mask | None:
        """Return the cells that clauses ask the path to end in, None without such a clause."""
        for demand in self.demands:
            if demand.goals is not None:
                return demand.goals
        return None

    def problem(self, closed: Mask | None, *, is_strict: bool) -> Enforced | None:
        """Return the problem with some cells closed; None if a strict one cannot be solved."""
        free = ~self.route.costmap.blocked
        reached = self.reached(free if closed is None else free & ~closed)
        goals = self.goals()
        if goals is not None and not (goals & reached).any():
            if is_strict:
                return None
            goals = None
        x, y = self.route.goal
        if goals is None and not reached[y, x]:
            return None
        regions: list[Mask] = []
        groups: list[tuple[int, ...]] = []
        crossings: list[Mask] = []
        for demand in self.demands:
            cells = [visited & reached for visited in demand.visits]
            if is_strict and demand.is_must and not all(mask.any() for mask in cells):
                return None
            cells = [mask for mask in cells if mask.any()]
            if demand.visits_in_order and cells:
                groups.append(tuple(range(len(regions), len(regions) + len(cells))))
                regions += cells
            else:
                crossings += cells
        if crossings and not groups:  # beside visits in order, blocking the wrong side must do
            groups.append(tuple(range(len(crossings))))
            regions += crossings
        befores = self.befores(regions, is_strict=is_strict)
        price = self.price(is_strict=is_strict)
        if not groups and not befores and goals is None and price is None:
            return Enforced(closed)
        made = (*([automata.visits(groups)] if groups else []), *befores)
        return Enforced(closed, ProductProblem(tuple(regions), made, goals, price))

    def reached(self, free: Mask) -> Mask:
        """Return the cells connected to the start, as the costmap's components are."""
        neighbours = np.ones((3, 3)) if self.route.costmap.config.corner_cutting else None
        labels, _ = ndimage.label(free, structure=neighbours)
        x, y = self.route.start
        connected: Mask = (labels == labels[y, x]) & free
        return connected

    def befores(self, regions: list[Mask], *, is_strict: bool) -> list[automata.Automaton]:
        """Return what is forbidden until something was visited; adds its masks to `regions`."""
        found = []
        x, y = self.route.start
        for demand in self.demands:
            if demand.before is None:
                continue
            first, later = demand.before
            price = MUST_PRICE if demand.is_must else SHOULD_PRICE
            if is_strict and demand.is_must and not later.touched[y, x]:
                price = math.inf
            found.append(automata.before(len(regions), len(regions) + 1, price))
            regions += [first, later.touched]
        return found

    def price(self, *, is_strict: bool) -> NDArray[np.float32] | None:
        """Return what each cell of length in a forbidden cell costs more, None for nothing."""
        total: NDArray[np.float32] | None = None
        for demand in self.demands:
            if demand.forbidden is None or (is_strict and self.is_blocking(demand)):
                continue
            price = MUST_PRICE if demand.is_must else SHOULD_PRICE
            if total is None:
                total = np.zeros(demand.forbidden.centres.shape, dtype=np.float32)
            total[demand.forbidden.touched] += price * TOUCHED_SHARE
            total[demand.forbidden.centres] += price * (1.0 - TOUCHED_SHARE)
        return None if total is None else np.minimum(total, MUST_PRICE)


def contradictions(demands: Sequence[Demand]) -> tuple[tuple[spec.Clause, spec.Clause], ...]:
    """Return the pairs of `must` clauses that no path on any map can keep together.

    Found without a search: what one asks to visit lies wholly in what the other forbids, or the
    two leave no cell, or they end in different places.
    """
    musts = [demand for demand in demands if demand.is_must and demand.problem is None]
    return tuple(
        (one.clause, other.clause)
        for number, one in enumerate(musts)
        for other in musts[number + 1 :]
        if excludes(one, other) or excludes(other, one) or leaves_nothing(one, other)
    )


def excludes(one: Demand, other: Demand) -> bool:
    """Tell whether one demand forbids all of a region that the other has to visit or end in."""
    if one.forbidden is None:
        return (
            one.goals is not None
            and other.goals is not None
            and not (one.goals & other.goals).any()
        )
    wanted = list(other.visits) if other.visits_in_order else []
    if other.goals is not None:
        wanted.append(other.goals)
    return any(cells.any() and not (cells & ~one.forbidden.centres).any() for cells in wanted)


def leaves_nothing(one: Demand, other: Demand) -> bool:
    """Tell whether two demands together forbid every cell, which neither does alone."""
    if one.forbidden is None or other.forbidden is None:
        return False
    first, second = one.forbidden.centres, other.forbidden.centres
    return bool((first | second).all() and not first.all() and not second.all())


def goal_cell(place: Place, costmap: Costmap) -> Cell:
    """Return the cell to go to: the free one nearest to the centre of the place.

    In an area it is well inside, at an object near it, and where there is a choice in the largest
    part of the map that can be driven. Raises PlaceGoalError where no cell is free.
    """
    route = Route(costmap, (0, 0), (0, 0), Places([place]))
    cells = visit_cells(spec.NamedPlace(place.name), route)
    if not cells.any():
        raise PlaceGoalError(f'no cell of {place.name!r} is free on this map')
    components = costmap.components[:, :]
    sizes = np.bincount(components.ravel())
    sizes[0] = 0
    cells &= components == max(np.unique(components[cells]), key=lambda number: sizes[number])
    centre = place.geometry.centroid
    x, y = costmap.grid_map.world_to_grid([(centre.x, centre.y)])[0]
    rows, columns = np.nonzero(cells)
    nearest = int(np.argmin((columns - x) ** 2 + (rows - y) ** 2))
    return int(columns[nearest]), int(rows[nearest])
