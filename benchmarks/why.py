"""Check and time what plans say where there is no path: `python -m benchmarks.why`.

Random problems without a path mix walls, zones, required clauses, unknown cells and a radius.
What a plan names is removed and planned again, which has to give a path; every smaller set of
causes is removed too, and must give none. Then the CPU time of the answer is measured.
"""

from __future__ import annotations

import argparse
import time
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, replace
from itertools import combinations

import numpy as np
import shapely
from llm_astar_msgs_adapter.maps.grid_map import OCCUPIED, UNKNOWN, GridMap
from llm_astar_planner.costmap.config import CostmapConfig
from llm_astar_planner.costmap.costmap import Costmap
from llm_astar_planner.costmap.zone_layer import ZoneLayer
from llm_astar_planner.costmap.zones import Zone
from llm_astar_planner.instructions.clauses.avoid import Avoid
from llm_astar_planner.instructions.interpretation import (
    Interpretation,
    RouteInstruction,
    Understanding,
)
from llm_astar_planner.instructions.regions import Box
from llm_astar_planner.instructions.specification import Specification
from llm_astar_planner.instructions.text import REQUIRE
from llm_astar_planner.planning.planner import Planner
from llm_astar_planner.planning.types import EXPLAINED, Plan, PlanRequest
from llm_astar_planner.planning.why import Explainer

SIZE, RESOLUTION = 24, 0.1
RADII = (0.0, 0.15, 0.25)
UNKNOWN_CELLS, RADIUS = ('unknown', ''), ('radius', '')


@dataclass(frozen=True)
class Problem:
    """A request on a map, and what may be removed from both; `names` are those of causes."""

    grid_map: GridMap
    config: CostmapConfig
    zones: tuple[Zone, ...]
    clauses: tuple[Avoid, ...]
    start: tuple[int, int]
    goal: tuple[int, int]

    def names(self) -> Iterator[tuple[str, str]]:
        """Yield the kind and name of each cause there may be."""
        yield from (('zone', zone.label) for zone in self.zones)
        yield from (('clause', clause.sentence()) for clause in self.clauses)
        if not self.config.allow_unknown:
            yield UNKNOWN_CELLS
        if self.config.robot_radius:
            yield RADIUS

    def without(self, names: Iterable[tuple[str, str]], radius: float = 0.0) -> Problem:
        """Return the problem without some causes, the radius reduced to `radius`."""
        gone = {*names}
        config = self.config
        if UNKNOWN_CELLS in gone:
            config = replace(config, allow_unknown=True)
        if RADIUS in gone:
            config = replace(config, robot_radius=radius)
        zones = tuple(zone for zone in self.zones if ('zone', zone.label) not in gone)
        clauses = tuple(one for one in self.clauses if ('clause', one.sentence()) not in gone)
        return replace(self, config=config, zones=zones, clauses=clauses)

    def plan(self) -> Plan:
        """Plan it."""
        grid_map = ZoneLayer(self.grid_map, self.zones, config=self.config).compose(self.grid_map)
        instruction = None
        if self.clauses:
            specification = Specification(self.clauses)
            reading = Interpretation('all', specification, 'test', Understanding.WHOLE)
            instruction = RouteInstruction(reading, policy=REQUIRE, want_prices=False)
        request = PlanRequest(self.start, self.goal, instruction=instruction, time_limit=60.0)
        return Planner(grid_map, self.config).plan(request)


def random_problem(random: np.random.Generator, size: int = SIZE) -> Problem:
    """Return a random problem, with a path or without."""
    cells = np.where(random.random((size, size)) < 0.02, OCCUPIED, 0)
    for _ in range(random.integers(1, 4)):
        line, gap = random.integers(2, size - 2, 2)
        wide = random.integers(0, 5)
        cells[line], cells[line, gap : gap + wide] = OCCUPIED, 0
        cells = cells.T
    for _ in range(random.integers(0, 3)):
        x, y, width, height = *random.integers(0, size, 2), *random.integers(2, 8, 2)
        part = cells[y : y + height, x : x + width]
        part[part == 0] = UNKNOWN
    boxes = []
    for _ in range(8):
        x, y = random.uniform(0.0, size * RESOLUTION, 2)
        width, height = random.uniform(0.2, 1.2, 2)
        boxes.append((x, y, x + width, y + height))
    counts = random.integers(0, 4), random.integers(0, 3)
    zones = tuple(Zone(f'z{n}', shapely.box(*boxes[n])) for n in range(counts[0]))
    clauses = tuple(Avoid(region=Box(*boxes[4 + n])) for n in range(counts[1]))
    config = CostmapConfig(
        robot_radius=float(random.choice(RADII)), allow_unknown=bool(random.random() < 0.4)
    )
    start, goal = (tuple(map(int, random.integers(0, size, 2))) for _ in range(2))
    grid_map = GridMap(cells.astype(np.int8), RESOLUTION)
    return Problem(grid_map, config, zones, clauses, (start[0], start[1]), (goal[0], goal[1]))


def failures(seed: int, count: int) -> Iterator[tuple[Problem, Plan]]:
    """Yield so many random problems that have no path, with their plans."""
    random, found = np.random.default_rng(seed), 0
    while found < count:
        problem = random_problem(random)
        plan = problem.plan()
        if plan.code in EXPLAINED:
            found += 1
            yield problem, plan


def check(problem: Problem, plan: Plan) -> tuple[bool, bool]:
    """Tell whether removing what a plan names opens a path, and whether no smaller set does."""
    if plan.why is None:
        return False, False
    causes = {(one['kind'], one.get('name', '')): one for one in plan.why.causes}
    every = list(problem.names())
    if plan.why.causes[0]['kind'] == 'walls':
        open_map = GridMap(np.minimum(problem.grid_map.cells, 0), RESOLUTION)
        bare = problem.without(every)
        return not replace(bare, grid_map=open_map).plan().code, bool(bare.plan().code)
    radius = causes.get(RADIUS, {}).get('passes', 0.0)
    opens = not problem.without(causes, radius).plan().code
    fewer = (names for size in range(len(causes)) for names in combinations(every, size))
    return opens, all(problem.without(names).plan().code for names in fewer)


def times(size: int, rounds: int) -> Iterator[tuple[str, float]]:
    """Yield for kinds of failures on a map of size x size cells the median CPU ms of `why`."""
    cells = np.where(np.random.default_rng(1).random((size, size)) < 0.0005, OCCUPIED, 0)
    half, length = size // 2, size * 0.05
    cells[:, half], cells[:, half - 8 : half], cells[:, half + 1 : half + 8] = OCCUPIED, 0, 0
    door = slice(half - 12, half + 13)
    wall = cells.copy()
    cells[door, half] = 0
    unknown = cells.copy()
    unknown[door, half] = UNKNOWN
    zone = Zone('zone', shapely.box(length / 2 - 0.3, 0.0, length / 2 + 0.3, length))
    for name, grid, radius, zones in (
        ('walls', wall, 0.2, ()),
        ('zone', cells, 0.2, (zone,)),
        ('unknown', unknown, 0.2, ()),
        ('radius', cells, 0.7, ()),
        ('radius and zone', cells, 0.7, (zone,)),
    ):
        config = CostmapConfig(robot_radius=radius, inflation_radius=0.8, allow_unknown=False)
        base = GridMap(grid.astype(np.int8), 0.05)
        costmap = Costmap(ZoneLayer(base, zones, config=config).compose(base), config)
        costmap.prepare()
        request = PlanRequest((size // 8, size // 8), (size - size // 8, size - size // 8))
        taken = []
        for _ in range(rounds + 1):
            began = time.thread_time()
            Explainer(costmap, request).explain()
            taken.append(time.thread_time() - began)
        yield name, 1000.0 * float(np.median(taken[1:]))


def main(arguments: Sequence[str] | None = None) -> None:
    """Check and measure; print the figures."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument('--problems', type=int, default=2000)
    parser.add_argument('--size', type=int, default=1024)
    parser.add_argument('--rounds', type=int, default=9)
    options = parser.parse_args(arguments)
    checked = [check(*found) for found in failures(0, options.problems)]
    opened, least = (sum(column) for column in zip(*checked))
    print(f'{opened} of {len(checked)} opened by removing what is named, {least} minimal')
    for name, milliseconds in times(options.size, options.rounds):
        print(f'{name}: {milliseconds:.1f} ms CPU')


if __name__ == '__main__':
    main()
