"""A robot drives in a closed loop: a plan each second, on a map with moving obstacles.

Every run is driven twice over the same obstacles: with the newest path each time, and with the
last way kept within `switch_margin`. Counted are the plans whose path leaves the one before by
more than a metre (flips), of those the ones whose old way was still free, and of these the ones
that gained no more than the margin; and how far and how long the robot drove.

`python -m benchmarks.keep_way` prints a table of both.
"""

from __future__ import annotations

import argparse
import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np
from llm_astar_planner.costmap.config import CostmapConfig
from llm_astar_planner.planning.plan_reuse import PathHistory, way_of
from llm_astar_planner.planning.planner import Planner
from llm_astar_planner.planning.types import LastPath, PlanRequest, ResultCode
from llm_astar_planner.search.any_angle import straight_path
from llm_astar_planner.search.result import Cell
from numpy.typing import NDArray

from benchmarks.cases import RESOLUTION
from benchmarks.live_maps import to_grid
from benchmarks.map_families import boxes

RUNS, SIZE, OBSTACLES = 20, 500, 25
# Metres a second, of the robot and of the obstacles, and seconds from plan to plan.
ROBOT_SPEED, OBSTACLE_SPEED, PERIOD = 1.0, 0.5, 1.0
OBSTACLE_RADIUS, FLIP = 0.4, 1.0
MARGIN = 0.05
# As on a costmap with NavFn's weight of inflated cells.
CONFIG = CostmapConfig(
    robot_radius=0.2, inflation_radius=0.55, cost_scaling_factor=3.0, cost_travel_multiplier=4.1
)
# Seconds after which a robot has not arrived.
LONGEST = 300
Cells = NDArray[np.int32]


class Path(NamedTuple):
    """The rest of a path: its cells [n, 2], and the ends [m, 2] of its straight lines."""

    cells: Cells
    points: Cells

    @classmethod
    def of(cls, way: LastPath, n: int) -> Path:
        """Return what is left of a way from its cell number n on."""
        cells = way.cells[n:]
        turns = way.cells[way.turns[way.turns > n]]
        return cls(cells, np.concatenate((cells[:1], turns)) if len(way.turns) else cells)


@dataclass
class Drive:
    """What came of one or several drives; `metres` and `seconds` of those that arrived."""

    arrived: int = 0
    plans: int = 0
    failed: int = 0
    flips: int = 0
    flips_free: int = 0
    flips_for_nothing: int = 0
    metres: float = 0.0
    seconds: int = 0

    def add(self, other: Drive) -> None:
        """Add the counts of another."""
        for name, value in vars(other).items():
            setattr(self, name, getattr(self, name) + value)


class World:
    """A map with boxes that stand and discs that move; the same for the same seed."""

    def __init__(self, seed: int, size: int = SIZE, obstacles: int = OBSTACLES) -> None:
        """Draw the boxes, the discs, and a start and a goal in opposite corners."""
        random = np.random.default_rng(seed)
        self.size = size
        self.static = boxes(size, random)
        self.static[[0, -1]] = self.static[:, [0, -1]] = True
        components = np.asarray(Planner(to_grid(self.static), CONFIG).costmap.components[:, :])
        largest = np.bincount(components[components > 0]).argmax()
        free = np.argwhere(components == largest)[:, ::-1]
        corners = np.array([[0, 0], [size, size]])
        nearest = [np.abs(free - corner).sum(axis=1).argmin() for corner in corners]
        self.start, self.goal = (tuple(free[n].tolist()) for n in nearest)
        self.places = random.uniform(0, size, (obstacles, 2))
        angles = random.uniform(0.0, 2.0 * math.pi, obstacles)
        step = OBSTACLE_SPEED * PERIOD / RESOLUTION
        self.steps = step * np.column_stack([np.cos(angles), np.sin(angles)])

    def maps(self) -> Iterator[NDArray[np.bool_]]:
        """Yield what is occupied, bool [height, width], each second."""
        rows, columns = np.ogrid[: self.size, : self.size]
        places, steps = self.places.copy(), self.steps.copy()
        radius = OBSTACLE_RADIUS / RESOLUTION
        while True:
            blocked = self.static.copy()
            for x, y in places:
                blocked |= (columns - x) ** 2 + (rows - y) ** 2 <= radius**2
            yield blocked
            steps *= np.where((places < 0) | (places >= self.size), -1.0, 1.0)
            places += steps


def drive(world: World, request: PlanRequest) -> Drive:
    """Drive from start to goal along each second's path."""
    done, ways, here = Drive(), PathHistory(), world.start
    planner, path = None, None
    for occupied in world.maps():
        grid_map = to_grid(occupied & ~near(here, world.size))
        planner = Planner(grid_map, CONFIG, previous=planner)
        asked = ways.add_to(replace(request, start=here, goal=world.goal), 'robot')
        plan = planner.plan(asked)
        ways.remember(plan, asked, 'robot', planner.costmap)
        done.plans += 1
        done.seconds += 1
        if plan.code is ResultCode.NONE:
            way = way_of(plan, planner.costmap)
            count_flip(done, planner, path, Path.of(way, 0))
            n, metres = moved_along(way.cells)
            here, path = (int(way.cells[n, 0]), int(way.cells[n, 1])), Path.of(way, n)
            done.metres += metres
        else:  # the robot waits
            done.failed += 1
        if here == world.goal:
            done.arrived = 1
            return done
        if done.seconds == LONGEST:
            return replace(done, metres=0.0, seconds=0)
    raise AssertionError('the world has no end')


def near(cell: Cell, size: int) -> NDArray[np.bool_]:
    """Return the cells under the robot: what moves keeps off them."""
    rows, columns = np.ogrid[:size, :size]
    reach = (CONFIG.robot_radius / RESOLUTION + 1.0) ** 2
    under: NDArray[np.bool_] = (columns - cell[0]) ** 2 + (rows - cell[1]) ** 2 <= reach
    return under


def moved_along(path: Cells) -> tuple[int, float]:
    """Return at which cell of its path the robot is after a period, and the metres driven."""
    lengths = RESOLUTION * np.hypot(*np.diff(path, axis=0).T)
    driven = np.concatenate(([0.0], np.cumsum(lengths)))
    n = int(np.searchsorted(driven, ROBOT_SPEED * PERIOD, side='right')) - 1
    return n, float(driven[n])


def count_flip(done: Drive, planner: Planner, old: Path | None, new: Path) -> None:
    """Count the new path if it leaves the rest of the old one by more than FLIP."""
    if old is None or RESOLUTION * farthest(new.cells, old.cells) <= FLIP:
        return
    done.flips += 1
    graph = planner.costmap.grid_graph
    before, now = straight_path(graph, old.points), straight_path(graph, new.points)
    if before is not None and now is not None:
        done.flips_free += 1
        done.flips_for_nothing += before.cost <= (1.0 + MARGIN) * now.cost


def farthest(path: Cells, other: Cells) -> float:
    """Return how far, in cells, a path gets from the nearest cell of another."""
    apart = path[:, None].astype(np.float64) - other[None]
    return float(np.hypot(apart[..., 0], apart[..., 1]).min(axis=1).max())


def table(rows: dict[str, Drive]) -> str:
    """Return the table in Markdown."""
    lines = [
        '||arrived|plans|without a path|flips|old way free|of these without the gain|metres|s|',
        '|---|---|---|---|---|---|---|---|---|',
    ]
    for name, row in rows.items():
        counts = (row.arrived, row.plans, row.failed, row.flips, row.flips_free)
        figures = (*counts, row.flips_for_nothing, f'{row.metres:.1f}', row.seconds)
        lines.append(f'|{name}|{"|".join(map(str, figures))}|')
    return '\n'.join(lines)


def main(arguments: Sequence[str] | None = None) -> int:
    """Print the table; 1 if a way changes without the gain while it is kept."""
    parser = argparse.ArgumentParser(description=__doc__)
    for name, default in (('runs', RUNS), ('size', SIZE), ('obstacles', OBSTACLES)):
        parser.add_argument(f'--{name}', type=int, default=default, help='%(default)s by default')
    parser.add_argument('--cells', action='store_true', help='paths of cells, not at any angle')
    options = parser.parse_args(arguments)
    request = PlanRequest(
        (0, 0), (0, 0), max_suboptimality=1.1, any_angle=not options.cells, start_tolerance=0.25,
        time_limit=60.0, want_expanded=False, tolerance=0.5,
    )  # fmt: skip
    rows: dict[str, Drive] = {}
    for name, margin in (('always the newest', 0.0), (f'kept within {MARGIN:.0%}', MARGIN)):
        total = rows.setdefault(name, Drive())
        for seed in range(options.runs):
            world = World(seed, options.size, options.obstacles)
            total.add(drive(world, replace(request, switch_margin=margin)))
    print(table(rows))
    return int(total.flips_for_nothing > 0)


if __name__ == '__main__':
    raise SystemExit(main())
