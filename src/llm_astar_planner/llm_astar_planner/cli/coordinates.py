"""The unit in which a command reads and writes the points of a map: metres or cells."""

from __future__ import annotations

import argparse
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from llm_astar_msgs_adapter.maps.barrier_map import Point
from llm_astar_msgs_adapter.maps.grid_map import FAR, GridMap
from llm_astar_msgs_adapter.maps.problem_maps import YAML, ProblemMap

from llm_astar_planner.parameter import ParameterError
from llm_astar_planner.search.result import Cell


@dataclass(frozen=True)
class Coordinates:
    """How points of one map are read and written.

    `offset` is what the map's file calls cell (0, 0). With `metres`, points are metres of the
    map's frame, else cells as the file counts them.
    """

    grid_map: GridMap
    offset: Point
    metres: bool

    def to_cell(self, option: str, point: Sequence[float]) -> Cell:
        """Return the cell (x, y) of a point that an option names, on the map or off it.

        Raises ParameterError for a cell that is not two whole numbers, and for a point that is
        not finite or farther than any map.
        """
        x, y = point
        if not max(abs(x), abs(y)) <= FAR:
            raise ParameterError(f'{option} {x:g} {y:g}: numbers up to {FAR:g} are expected')
        if self.metres:
            return self.grid_map.world_to_cell(x, y)
        if not (float(x).is_integer() and float(y).is_integer()):
            raise ParameterError(
                f'{option} {x:g} {y:g}: coordinates are cells on this map, so whole numbers; '
                'add --metres to give metres'
            )
        return int(x) - self.offset[0], int(y) - self.offset[1]

    def could_be_cell(self, point: Sequence[float]) -> bool:
        """Tell whether a point's numbers would also be a cell of the map."""
        x, y = point
        return x.is_integer() and y.is_integer() and self.grid_map.contains((int(x), int(y)))

    def describe(self, x: float, y: float) -> str:
        """Return a point given in grid coordinates as text: metres and cell, or cell alone."""
        cell = f'cell ({x + self.offset[0]:g}, {y + self.offset[1]:g})'
        if not self.metres:
            return cell
        ((east, north),) = self.grid_map.grid_to_world([(x, y)]).tolist()
        return f'({round(east, 3):g}, {round(north, 3):g}) m, {cell}'

    def describe_length(self, cells: float) -> str:
        """Return a length given in cells as text, in metres first if points are in metres."""
        text = f'{cells:.2f} cells'
        return f'{self.grid_map.resolution * cells:.2f} m, {text}' if self.metres else text

    def describe_distance(self, metres: float) -> str:
        """Return a distance given in metres as text, in the unit of the points."""
        if self.metres:
            return f'{metres:.2f} m'
        return f'{metres / self.grid_map.resolution:.2f} cells'


def add_unit_options(group: Any) -> None:  # noqa: ANN401 - argparse keeps its type private
    """Add `--cells` and `--metres`, of which one may be given."""
    units = group.add_mutually_exclusive_group()
    units.add_argument(
        '--metres',
        action='store_true',
        help="points are metres of the map's frame: the default on a map_server yaml",
    )
    units.add_argument(
        '--cells',
        action='store_true',
        help='points are cells, as the map counts them: the default on all other maps',
    )


def coordinates_of(
    arguments: argparse.Namespace, problem: ProblemMap, grid_map: GridMap
) -> Coordinates:
    """Return the unit of a map's points: by the options, else by the kind of the map's file."""
    is_robot_map = arguments.query is None and Path(arguments.map).suffix.lower() in YAML
    return Coordinates(
        grid_map, problem.offset, arguments.metres or (is_robot_map and not arguments.cells)
    )
