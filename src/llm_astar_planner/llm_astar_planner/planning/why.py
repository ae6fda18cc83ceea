# Copyright 2026 The LLM-A* for ROS 2 contributors
# SPDX-License-Identifier: Apache-2.0

"""Why there is no path: the fewest causes whose removal opens a way, and what passes instead.

What closes cells is parted into causes: each clause, zone and mask, unknown cells, the robot's
radius. Cells closed by the same causes are one group; a best-first search over sets of causes
floods what each set opens from where the smaller set ended, so the first set that reaches the
goal is a smallest one. Where all together do not, walls do it. How wide a robot passes is found
by a widest path search. Rules of the road are causes too; where there are some, floods follow the
moves that these leave.
"""

from __future__ import annotations

import heapq
import math
import time
from collections.abc import Callable, Sequence
from contextlib import suppress
from dataclasses import replace
from itertools import count
from typing import Any, NamedTuple

import numpy as np
from llm_astar_msgs_adapter.maps.grid_map import OCCUPIED, GridMap

from llm_astar_planner.costmap._kernels import changed_windows
from llm_astar_planner.costmap.config import CostmapConfig
from llm_astar_planner.costmap.costmap import Costmap, inflate, inflation_reach, squared_cells
from llm_astar_planner.instructions.route import Route
from llm_astar_planner.instructions.text import REQUIRE
from llm_astar_planner.planning._kernels import causes as kernels
from llm_astar_planner.planning.endpoints import moved_start, nearest_reached, window_around
from llm_astar_planner.planning.types import Plan, PlanningFailure, PlanRequest, Point, Why
from llm_astar_planner.search.arrays import Bools, DoubleBuffer, Int32s, Uint8s, no_stop
from llm_astar_planner.search.astar import exact_astar, jump_search
from llm_astar_planner.search.grid_graph import STEPS, GridGraph, path_length
from llm_astar_planner.search.result import Cell

Items = frozenset[int]
Window = tuple[slice, slice]
WHOLE: Window = slice(None), slice(None)
NOTHING: Items = frozenset()
# Of sets with equally many causes, what a person changes most easily is named: this order.
CLAUSE, ZONE, ONE_WAY, KEEP_RIGHT, MASK, UNKNOWN, RADIUS = ORDER = (
    'clause', 'zone', 'one_way', 'keep_right', 'mask', 'unknown', 'radius'
)  # fmt: skip
WALLS = 'walls'
# How much one place in this order counts: less than one cause more.
PLACE = 1e-4
# Sets tried before it is looked at whether all causes together close the way, and before a set
# will do that cannot spare any of its causes.
SOON, MOST_SETS = 8, 256
# Via points up to which rules of the road are followed from one to the next.
MOST_STOPS = 20
# Metres, to which the widest way is measured of a robot whose size is not known.
WIDEST = 10.0
ROUNDING = 1e-6
NAMED = {
    CLAUSE: 'the instruction "{name}"', ZONE: 'zone {name}', ONE_WAY: 'the one-way {name}',
    KEEP_RIGHT: 'the keep-right lane {name}', MASK: 'the filter mask {name}',
    UNKNOWN: 'unknown cells between {from} and {to}', RADIUS: "the robot's radius of {radius:g} m",
}  # fmt: skip


class CauseLayers:
    """The cells in groups that the same causes close; walls, which nothing opens, are group 0.

    `groups` is int32 [height + 2, width + 2], framed by walls, `cells` the map's part of it.
    """

    def __init__(self, walls: Bools) -> None:
        """Start with walls, bool [height, width], and nothing else closed."""
        self.groups = np.pad(~walls, 1).astype(np.int32)
        self.cells = self.groups[1:-1, 1:-1]
        self.sets: list[Items | None] = [None, NOTHING]
        self._numbers: dict[Items, int] = {NOTHING: 1}

    def close(self, cause: int, closed: Bools, window: Window = WHOLE) -> None:
        """Let a cause close cells of a window of the map."""
        part = self.cells[window]
        inside = part[closed]
        table = np.arange(len(self.sets), dtype=np.int32)
        for number in np.flatnonzero(np.bincount(inside, minlength=len(self.sets))).tolist():
            before = self.sets[number]
            if before is not None:
                table[number] = self._numbers.setdefault(before | {cause}, len(self.sets))
                if table[number] == len(self.sets):
                    self.sets.append(before | {cause})
        part[closed] = table[inside]

    def is_open(self, removed: Items) -> Bools:
        """Return which groups are open without some causes: bool [groups]."""
        return np.array([items is not None and items <= removed for items in self.sets])


class Flood(NamedTuple):
    """What is reached: `target` is a flat cell or -1, `edges` the closed cells that were met.

    `rules` are causes that forbid moves from there to cells that are not reached.
    """

    target: int
    seen: Uint8s
    edges: Int32s
    rules: tuple[int, ...] = ()


class Goals(NamedTuple):
    """A question to the kernels, on flat cells of the map with its frame."""

    steps: Int32s
    start: int
    targets: Bools

    @classmethod
    def of(cls, costmap: Costmap, start: Cell, goal: Cell, tolerance: float) -> Goals:
        """Ask for a cell at most `tolerance` metres from `goal`."""
        height, width = costmap.blocked.shape
        across, reach = width + 2, squared_cells(tolerance, costmap.grid_map.resolution)
        targets = np.zeros((height + 2, width + 2), dtype=np.bool_)
        rows, columns = window_around(targets.shape, (goal[0] + 1, goal[1] + 1), math.isqrt(reach))
        y, x = np.ogrid[rows, columns]
        targets[rows, columns] = (x - goal[0] - 1) ** 2 + (y - goal[1] - 1) ** 2 <= reach
        # The last is followed first: along rows, as they lie in memory.
        steps = [across, -across, 1, -1]
        if costmap.config.corner_cutting:
            steps = [across + 1, across - 1, 1 - across, -1 - across, *steps]
        first = (start[1] + 1) * across + start[0] + 1
        return cls(np.array(steps, dtype=np.int32), first, targets.reshape(-1))

    def cell(self, number: int) -> Cell:
        """Return the cell (x, y) of the map that has a number here."""
        y, x = divmod(number, int(self.steps[-4]))
        return x - 1, y - 1

    def flood(self, layers: CauseLayers, removed: Items, before: Flood | None = None) -> Flood:
        """Reach what is open without some causes, further than `before` without fewer did."""
        groups, is_open = layers.groups.reshape(-1), layers.is_open(removed)
        start = np.array([self.start], dtype=np.int32)
        _, seen, edges, _ = before or Flood(-1, np.zeros(groups.size, dtype=np.uint8), start)
        seen, is_first = seen.copy(), is_open[groups[edges]]
        first = edges[is_first]
        target, met = kernels.flood(groups, is_open, self.steps, self.targets, seen, first)
        return Flood(target, seen, np.concatenate((edges[~is_first], met)))


class Causes:
    """All that closes cells of a costmap, by number; `names` are pairs of a kind and a name."""

    def __init__(self, costmap: Costmap, clauses: Sequence[tuple[str, Bools]] = ()) -> None:
        """Take a costmap, and which of its cells each clause of an instruction closes."""
        grid_map, config = costmap.grid_map, costmap.config
        composed, threshold = grid_map.composed, config.obstacle_threshold
        self.base = grid_map if composed is None else composed.base
        self.config = replace(config, inflation_radius=0.0, allow_unknown=True)
        self.resolution = grid_map.resolution
        self.lethal = self.base.cells >= threshold
        self.names: list[tuple[str, str]] = []
        self.radius = -1
        if config.has_radius and (config.allow_unknown or not (self.base.cells < 0).any()):
            # Only around zones these differ from those of the map with them.
            reach = inflation_reach(self.base, config)
            changed = changed_windows(grid_map.cells, self.base.cells, reach)
            before = costmap.blocked, np.empty_like(self.base.cells)
            walls, _ = inflate(self.base, config, before, changed, DoubleBuffer())
        else:
            walls, _ = inflate(self.base, self.config)
        self.layers = [CauseLayers(walls)]
        # Without the robot's radius, also that with which a costmap was inflated.
        if config.robot_radius > 0.0 or threshold > config.occupied_threshold:
            self.layers.append(CauseLayers(self.lethal))
            self.radius = self.add(RADIUS)
        for name, closed in clauses:
            self.add(CLAUSE, name, closed)
        # These are lethal, so they too keep the robot away by its radius.
        self.zones: dict[int, tuple[Window, Bools]] = {}
        for kind, name, window, closed in () if composed is None else composed.closed():
            self.zones[self.add(kind, name, closed, window)] = window, closed
        if not config.allow_unknown:
            self.add(UNKNOWN, '', self.base.cells < 0)
        # Each forbids moves in a window.
        self.rules: dict[int, tuple[Window, Uint8s]] = {}
        for kind, name, window, moves in () if composed is None else composed.rules():
            self.rules[self.add(kind, name)] = window, moves

    def add(
        self, kind: str, name: str = '', closed: Bools | None = None, window: Window = WHOLE
    ) -> int:
        """Add what closes cells of a window, a zone or mask also around it; return its number."""
        number = len(self.names)
        self.names.append((kind, name))
        if closed is not None:
            self.layers[-1].close(number, closed, window)
        if closed is not None and len(self.layers) > 1:
            if kind in (ZONE, MASK):
                window, closed = grown(window, closed, self.base, self.config)
            self.layers[0].close(number, closed, window)
        return number

    def price(self, removed: Items) -> float:
        """Return how much a set of causes is: the least is named."""
        return sum(1.0 + PLACE * ORDER.index(self.names[item][0]) for item in removed)

    def layers_of(self, removed: Items) -> CauseLayers:
        """Return the layers without some causes."""
        return self.layers[-1 if self.radius in removed else 0]

    def flood(self, goals: Goals, removed: Items, before: Flood | None = None) -> Flood:
        """Reach what is open without some causes."""
        if self.rules:
            return self.drive(goals, removed)
        return goals.flood(self.layers_of(removed), removed, before)

    def forbidden(self, removed: Items) -> Uint8s:
        """Return the moves that rules of the road forbid without some of them, empty for none."""
        forbidden = np.zeros(self.lethal.shape if self.rules else (0, 0), dtype=np.uint8)
        for item in self.rules.keys() - removed:
            window, moves = self.rules[item]
            forbidden[window] |= moves
        return forbidden

    def graph(self, blocked: Bools, removed: Items) -> GridGraph:
        """Return the graph of the moves that are left without some causes."""
        grid = GridGraph(blocked, corner_cutting=self.config.corner_cutting)
        return grid.with_rules(self.forbidden(removed))

    def drive(self, goals: Goals, removed: Items) -> Flood:
        """Reach what the moves that are left without some causes lead to."""
        layers = self.layers_of(removed)
        blocked = ~layers.is_open(removed)[layers.cells]
        grid = self.graph(blocked, removed)
        reached = np.pad(grid.reach(goals.cell(goals.start)), 1)
        around = np.zeros_like(reached)
        lost = np.zeros(blocked.shape, dtype=np.uint8)
        left_out = (grid.without_rules.moves & ~grid.moves).reshape(blocked.shape)
        for bit, (x, y) in enumerate(STEPS):
            around |= np.roll(reached, (y, x), (0, 1))
            leads_on = ~np.roll(reached, (-y, -x), (0, 1)) & reached
            lost |= left_out & leads_on[1:-1, 1:-1].astype(np.uint8) << bit
        edges = np.flatnonzero(around & ~reached & np.pad(blocked, 1)).astype(np.int32)
        seen = reached.astype(np.uint8).reshape(-1)
        seen[edges] = kernels.EDGE
        hits = np.flatnonzero(reached.reshape(-1) & goals.targets)
        rules = [
            item
            for item, (window, moves) in self.rules.items()
            if item not in removed and (lost[window] & moves).any()
        ]
        return Flood(int(hits[0]) if len(hits) else -1, seen, edges, tuple(rules))

    def least(self, goals: Goals, reached: Flood) -> tuple[Items, int] | None:
        """Return a smallest set of causes without which a way leads to the goal, None for none.

        And to which cell it leads. `reached` is what the start reaches with all of them.
        """
        if reached.target >= 0:
            return NOTHING, reached.target
        numbers, done, every = count(), set[Items](), frozenset(range(len(self.names)))
        # What is open with the radius is so without it.
        roots = [NOTHING] + [frozenset({self.radius})] * (self.radius >= 0)
        queue = [(self.price(root), next(numbers), root, reached) for root in roots]
        while queue:
            _, _, removed, before = heapq.heappop(queue)
            if removed in done:
                continue
            done.add(removed)
            if len(done) == SOON and self.flood(goals, every).target < 0:
                return None
            if len(done) > MOST_SETS:
                removed = self.without_spare(goals, every)
            found = self.flood(goals, removed, before if len(done) <= MOST_SETS else None)
            if found.target >= 0:
                return removed, found.target
            layers = self.layers_of(removed)
            met = np.bincount(layers.groups.reshape(-1)[found.edges], minlength=1)
            closing = [layers.sets[number + 1] for number in np.flatnonzero(met[1:]).tolist()]
            for causes in [*closing, *(frozenset({rule}) for rule in found.rules)]:
                more = removed | (causes or NOTHING)
                heapq.heappush(queue, (self.price(more), next(numbers), more, found))
        return None

    def without_spare(self, goals: Goals, removed: Items) -> Items:
        """Return what remains of a set that opens a way without each cause that it can spare."""
        for item in sorted(removed):
            fewer = removed - {item}
            removed = fewer if self.flood(goals, fewer).target >= 0 else removed
        return removed

    def room(self, removed: Items) -> Int32s:
        """Return how far each open cell is from what stays lethal, squared, in cells.

        Int32 [height, width] with the frame, 0 where it is closed; at most what a robot needs.
        """
        lethal, layers = self.lethal.copy(), self.layers_of(removed)
        for number, (window, closed) in self.zones.items():
            if number not in removed:
                lethal[window] |= closed
        metres = self.config.robot_radius or WIDEST
        reach = min(math.isqrt(squared_cells(metres, self.resolution)) + 1, max(lethal.shape))
        # Where the robot passes there is room enough, which is not measured.
        groups = (
            part for one in (layers, self.layers[0]) for part in (one.cells, one.is_open(removed))
        )
        room: Int32s = kernels.room_of(lethal, reach, *groups)
        return room


def grown(
    window: Window, lethal: Bools, grid_map: GridMap, config: CostmapConfig
) -> tuple[Window, Bools]:
    """Return the cells that lethal cells of a window close to the robot, and their window."""
    reach = math.isqrt(squared_cells(config.robot_radius, grid_map.resolution))
    around = tuple(slice(max(part.start - reach, 0), part.stop + reach) for part in window)
    cells = np.zeros_like(grid_map.cells)
    cells[window][lethal] = OCCUPIED
    return (around[0], around[1]), inflate(GridMap(cells[around], grid_map.resolution), config)[0]


class Explainer:
    """Says why there is no path."""

    def __init__(self, costmap: Costmap, request: PlanRequest) -> None:
        """Take a request: of its via points and its goal, the first that cannot be reached."""
        self.costmap, self.start = costmap, request.start
        tolerance, stops = request.tolerance, [*request.via, request.goal]
        if not costmap.components.at(self.start):
            with suppress(PlanningFailure):
                self.start = moved_start(costmap, request)
        for self.reached, stop in enumerate(stops):
            few = len(stops) <= MOST_STOPS
            components = costmap.reached(self.start) if few else costmap.components
            here = components, components.at(self.start)
            if nearest_reached(costmap, here, stop, tolerance) is None:
                break
            if costmap.grid_graph.has_rules and stop != request.goal:
                self.start = stop
        self.goal, is_via = stops[self.reached], self.reached < len(request.via)
        self.name = f'via {self.reached + 1}' if is_via else 'goal'
        self.causes = Causes(costmap, clause_masks(costmap, request, self.start))
        self.goals = Goals.of(costmap, self.start, self.goal, tolerance)
        self.here = self.causes.flood(self.goals, NOTHING)

    def explain(self) -> Why | None:
        """Return why, None where no cell is in the way."""
        found = self.causes.least(self.goals, self.here)
        entries, length = list[dict[str, Any]](), None
        if found is None:
            entries = [self.walls()]
        elif found[0]:
            entries, length = self.opened(*found)
        else:
            return None
        return self.why(entries, length, *self.nearest())

    def opened(self, removed: Items, target: int) -> tuple[list[dict[str, Any]], float | None]:
        """Return some causes as values, and the metres of the shortest path without them."""
        causes, layers, entries = self.causes, self.causes.layers_of(removed), []
        widest: dict[str, Any] = {}
        if causes.radius in removed:
            cells, widest = self.widest_path(removed)
        else:
            cells = np.zeros((0, 2), dtype=np.int32)
        if not len(cells):
            blocked, widest = ~layers.is_open(removed)[layers.cells], {}
            cells = self.path(blocked, self.goals.cell(target), removed)
        on_path = layers.cells[cells[:, 1], cells[:, 0]]
        for item in sorted(removed):
            kind, name = causes.names[item]
            entry: dict[str, Any] = {'kind': kind, 'name': name}
            if kind == RADIUS:
                entry = {'kind': kind, 'radius': causes.config.robot_radius, **widest}
            closes = np.array([item in (items or NOTHING) for items in layers.sets])
            is_met = closes[on_path]
            if item in causes.rules:
                others = frozenset(causes.rules) - {item}
                is_met = causes.forbidden(others)[cells[:, 1], cells[:, 0]] > 0
            met = cells[is_met].tolist()
            ends = {'from': self.metres(met[0]), 'to': self.metres(met[-1])} if met else {}
            entries.append(entry | ends)
        return entries, round(path_length(cells) * causes.resolution, 3)

    def path(self, blocked: Bools, goal: Cell, removed: Items) -> Int32s:
        """Return the shortest path on cells and by moves that would be open."""
        grid = self.causes.graph(blocked, removed)
        if not (grid.corner_cutting or grid.has_rules):
            return jump_search(grid, self.start, goal, stop=no_stop()).path
        return exact_astar(grid, self.start, goal, want_expanded=False).path

    def widest_path(self, removed: Items) -> tuple[Int32s, dict[str, Any]]:
        """Return the shortest of the widest ways, which robots pass it, and where it is narrow."""
        room, (steps, _, targets) = self.causes.room(removed), self.goals
        layers, ends = self.causes.layers[0], np.flatnonzero(targets)
        # From where the robot reaches an end as wide as it is, the way gets no narrower.
        for end in ends[layers.groups.reshape(-1)[ends] == 1][:1]:
            there = Goals(steps, int(end), np.zeros_like(targets)).flood(layers, NOTHING)
            targets = targets | (there.seen == kernels.REACHED)
        target, least, where = kernels.widest(
            room.reshape(-1), steps, targets, self.here.seen.copy(), self.here.edges
        )
        target = target if self.goals.targets[target] else int(end)
        cells = self.path(room[1:-1, 1:-1] < least, self.goals.cell(target), removed)
        passes = below(math.sqrt(least) * self.causes.resolution)
        return cells, {'passes': passes, 'at': self.metres(self.goals.cell(where))}

    def walls(self) -> dict[str, Any]:
        """Say what only walls close: an end in one of them, or the smaller of two rooms."""
        groups, areas = self.causes.layers[-1].groups.reshape(-1), {}
        targets = np.flatnonzero(self.goals.targets)
        for name, ends in (('start', np.array([self.goals.start])), (self.name, targets)):
            free = ends[groups[ends] > 0]
            if not len(free):
                return {'kind': WALLS, 'holds': name}
            room = Goals(self.goals.steps, int(free[0]), np.zeros_like(self.goals.targets))
            every = frozenset(range(len(self.causes.names)))
            seen = self.causes.flood(room, every).seen
            areas[name] = float((seen == kernels.REACHED).sum()) * self.causes.resolution**2
        name = min(areas, key=lambda end: areas[end])
        return {'kind': WALLS, 'room': name, 'area': round(areas[name], 3)}

    def nearest(self) -> tuple[Cell | None, float | None]:
        """Return the cell reached nearest to the goal, and how far off; None for the goal."""
        seen = self.here.seen.reshape(self.causes.layers[0].groups.shape)[1:-1, 1:-1]
        row, column = kernels.nearest_reached(seen, *self.goal)
        if row < 0 or (column, row) == self.goal:
            return None, None
        cells = math.dist((column, row), self.goal)
        return (column, row), round(cells * self.causes.resolution, 3)

    def metres(self, cell: Sequence[int]) -> Point:
        """Return the centre of a cell in metres of the map's frame."""
        point: Point = self.costmap.grid_map.grid_to_world([cell])[0].round(3).tolist()
        return point

    def place(self, point: Point) -> str:
        """Name a point by its metres, and by its cell on maps without metres."""
        x, y = point
        words = self.costmap.describe_cell(self.costmap.grid_map.world_to_cell(x, y))
        return words.rpartition(' at ')[2]

    def why(
        self,
        entries: list[dict[str, Any]],
        length: float | None,
        cell: Cell | None,
        short_of: float | None,
    ) -> Why:
        """Return the answer, with the sentence for a person."""
        said = ' and '.join(map(self.phrase, entries))
        if length is not None:
            verb, them = ('closes', 'it') if len(entries) == 1 else ('close', 'them')
            said += f' {verb} the way, of {length:.2f} m without {them}'
        for entry in entries:
            if 'passes' in entry:
                said += f'; a radius of {entry["passes"]:g} m passes, at {self.place(entry["at"])}'
        nearest = None if cell is None else self.metres(cell)
        if nearest is not None:
            said += f'; the nearest point reached is {self.place(nearest)}, {short_of:.2f} m off'
        return Why(said, entries, length, nearest, short_of, cell, self.reached)

    def phrase(self, entry: dict[str, Any]) -> str:
        """Return what one cause is, in words."""
        kind = entry['kind']
        if kind == WALLS and 'holds' in entry:
            return f'the {entry["holds"]} lies in an obstacle of the map'
        if kind == WALLS:
            return f'walls close the room of {entry["area"]:g} m2 that the {entry["room"]} is in'
        if kind == RADIUS and not entry['radius']:
            return 'the inflation of the costmap'
        points = {end: self.place(entry[end]) for end in ('from', 'to', 'at') if end in entry}
        return NAMED[kind].format_map(entry | points)


def below(metres: float) -> float:
    """Return the greatest number of whole millimetres that is less, else a little less."""
    whole = math.ceil(1000.0 * metres - ROUNDING) - 1
    return whole / 1000.0 if whole > 0 else metres * (1.0 - ROUNDING)


def clause_masks(costmap: Costmap, request: PlanRequest, start: Cell) -> list[tuple[str, Bools]]:
    """Return the sentence of each clause that is required, and which cells it closes."""
    instruction = request.instruction
    if instruction is None or instruction.policy != REQUIRE:
        return []
    # Many modules, which plans without an instruction do not need.
    from llm_astar_planner.instructions.enforcement import Enforcer, demands_of  # noqa: PLC0415

    route = Route(costmap, start, request.goal, instruction.places, instruction.driven)
    enforcer = Enforcer(demands_of(instruction.interpretation.specification, route), route)
    closing = []
    for demand in enforcer.demands:
        closed, priced = enforcer.barred(demand)
        # What an end lies in has a price there, and no path keeps it.
        closed = priced.touched if closed is None and priced is not None else closed
        if closed is not None and demand.is_must:
            closing.append((demand.clause.sentence(), closed))
    return closing


def explained(
    costmap: Costmap,
    request: PlanRequest,
    plan: Plan,
    plan_again: Callable[[PlanRequest], Plan],
    deadline: float,
) -> Plan:
    """Return a plan without a path with the reason, or where it may the path as near as it can.

    That is what `plan_again` plans until the `deadline`, in monotonic seconds.
    """
    try:
        why = Explainer(costmap, request).explain()
    except ArithmeticError:  # a path too long for the records of a search
        why = None
    if why is None:
        return plan
    failed = replace(plan, message=f'{plan.message}; {why.sentence}', why=why)
    if not request.allow_partial_planning or why.cell in (None, plan.start):
        return failed
    nearer = replace(
        request, goal=why.cell, via=request.via[: why.reached], goal_yaw=None,
        allow_partial_planning=False, last_path=None, time_limit=deadline - time.monotonic(),
    )  # fmt: skip
    partial, short_of = plan_again(nearer), why.short_of or 0.0
    if partial.code:
        return failed
    warning = f'the path is partial, {short_of:.2f} m short of the goal: {failed.message}'
    return replace(
        partial, message=f'partial: {partial.message}', warnings=(*partial.warnings, warning),
        goal_shift=short_of, why=why, partial=True,
    )  # fmt: skip
