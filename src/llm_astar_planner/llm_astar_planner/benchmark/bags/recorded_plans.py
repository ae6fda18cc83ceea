"""When a bag's request was made, and what the robot's own stack made of it."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from llm_astar_planner.benchmark.results import cells_along, format_points, turning_points
from llm_astar_planner.planning.planner import Planner

# Cells of a path beyond which it is no robot's, and not looked at cell by cell.
LONGEST = 10_000_000


@dataclass(frozen=True, eq=False)
class Occasion:
    """One request of a bag: `time` is when it was made (ns since 1970).

    `points` [n, 2] is the recorded path in grid coordinates: empty where the stack found none,
    None where nothing was recorded. `code` and `waypoints` (grid coordinates) are from a report.
    """

    bag: str
    request: int
    time: int
    map_digest: str
    points: NDArray[np.float64] | None = None
    code: str = ''
    waypoints: tuple[tuple[float, float], ...] = ()

    def columns(self, planner: Planner) -> dict[str, Any]:
        """Return the columns of a row that tell of it; the path is judged by `planner`'s rules."""
        columns: dict[str, Any] = {
            'bag': self.bag,
            'request': self.request,
            'stamp': self.time / 1e9,
            'map_digest': self.map_digest,
            'recorded_code': self.code,
            'recorded_waypoints': format_points(self.waypoints),
        }
        if self.points is None:
            return columns
        if len(self.points) == 0:
            return columns | {'recorded_problem': 'it is empty'}
        length = float(np.hypot(*np.diff(self.points, axis=0).T).sum())
        if length > LONGEST:
            too_long = f'it is over {LONGEST} cells long'
            return columns | {'recorded_length': length, 'recorded_problem': too_long}
        cells = cells_along(self.points)
        start, goal = ((int(x), int(y)) for x, y in (cells[0], cells[-1]))
        return columns | {
            'recorded_length': length,
            'recorded_problem': planner.path_problem(cells, start, goal) or '',
            'recorded_path': format_points(turning_points(cells)),
        }
