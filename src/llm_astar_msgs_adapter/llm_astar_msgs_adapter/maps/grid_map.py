# Copyright 2026 The LLM-A* for ROS 2 contributors
# SPDX-License-Identifier: Apache-2.0

"""An occupancy grid as plain values: cells, resolution, and its pose in the world."""

from __future__ import annotations

import hashlib
import math
from collections.abc import Iterator
from dataclasses import dataclass
from functools import cached_property
from typing import Any, NamedTuple, Protocol

import numpy as np
from numpy.typing import ArrayLike, NDArray

from llm_astar_msgs_adapter.errors import LlmAstarError

UNKNOWN = -1
FREE = 0
OCCUPIED = 100
# Of a map that is read from a file: ten times the 4000 x 4000 cells that the planner is made for.
MAX_CELLS = 160_000_000
# Cells that fit into a processor's cache: large maps are read from memory once for a check.
PIECE = 1 << 18
MIN_RESOLUTION = 1e-6
NO_RULES: NDArray[np.uint8] = np.zeros((0, 0), dtype=np.uint8)
# A point nearer to a cell border than this, in cells, lies on the border.
BORDER_TOLERANCE = 1e-6
# Metres. Points beyond are off any map, and their cells might overflow.
FAR = 1e12


class GridMapError(LlmAstarError, ValueError):
    """A malformed map, pose or transform; `field` is the name of the field that is wrong."""

    def __init__(self, field: str, problem: str) -> None:
        """Take the field and what is wrong with it."""
        super().__init__(f'{field}: {problem}')
        self.field = field


class Pose2D(NamedTuple):
    """A pose in the plane: metres and radians."""

    x: float
    y: float
    yaw: float = 0.0

    def transform(self, points: ArrayLike) -> NDArray[np.float64]:
        """Return where points [n, 2] of the frame with this pose are in the frame of the pose."""
        cos, sin = math.cos(self.yaw), math.sin(self.yaw)
        turned: NDArray[np.float64] = np.asarray(points) @ np.array([[cos, sin], [-sin, cos]])
        return turned + (self.x, self.y)


ORIGIN = Pose2D(0.0, 0.0)


class Composed(Protocol):
    """What was composed onto a map: `base` is the map without it."""

    @property
    def base(self) -> GridMap:
        """The map without what was composed onto it."""

    @property
    def forbidden(self) -> NDArray[np.uint8]:
        """The moves that rules of the road forbid, see `GridMap.forbidden`."""

    def closed(self) -> Iterator[tuple[str, str, tuple[slice, slice], NDArray[np.bool_]]]:
        """Yield of all that closes cells its kind, name and window, and which cells of that."""

    def rules(self) -> Iterator[tuple[str, str, tuple[slice, slice], NDArray[np.uint8]]]:
        """Yield of each rule of the road its kind, name, window, and what it forbids there."""

    def without_each(self) -> Iterator[tuple[str, GridMap]]:
        """Yield the label of each zone, with the map without it."""


@dataclass(frozen=True, eq=False)
class GridMap:
    """An occupancy grid in plain values.

    `cells` is int8 [height, width], -1 unknown, 0 to 100 occupancy, row 0 at the origin.
    `resolution` is metres a cell. `origin` is the pose of the outer corner of cell (0, 0) in
    `frame_id`, as in nav_msgs/MapMetaData. A cell is named (x, y), column before row. `zones`
    names the zones that were composed onto the cells, and `composed` tells them apart; maps with
    equal cells are equal without.
    Raises GridMapError on a malformed shape, value, resolution, origin or frame.
    """

    cells: NDArray[np.int8]
    resolution: float = 1.0
    origin: Pose2D = ORIGIN
    frame_id: str = 'map'
    zones: tuple[str, ...] = ()
    composed: Composed | None = None

    def __post_init__(self) -> None:
        """Check the fields and make the cells read-only."""
        cells = np.asarray(self.cells)
        if cells.ndim != 2 or cells.size == 0:
            problem = f'shape {cells.shape} is not [height, width], both above 0'
            raise GridMapError('cells', problem)
        pieces = min(len(cells), cells.size // PIECE + 1)
        if not all(map(is_occupancy, np.array_split(cells, pieces))):
            raise GridMapError('cells', 'values must lie in -1 to 100')
        if not (math.isfinite(self.resolution) and self.resolution > MIN_RESOLUTION):
            raise GridMapError('resolution', f'{self.resolution} is not above {MIN_RESOLUTION} m')
        if not all(math.isfinite(value) for value in self.origin):
            raise GridMapError('origin', f'{tuple(self.origin)} is not finite')
        if max(abs(self.origin.x), abs(self.origin.y)) > FAR:
            raise GridMapError('origin', f'{tuple(self.origin)} is over {FAR:g} m away')
        if not self.frame_id:
            raise GridMapError('frame_id', 'is empty')
        cells = np.ascontiguousarray(cells, dtype=np.int8)
        if cells.flags.writeable:
            cells = cells.copy()
            cells.flags.writeable = False
        object.__setattr__(self, 'cells', cells)

    @property
    def width(self) -> int:
        """Cells along x."""
        return int(self.cells.shape[1])

    @property
    def height(self) -> int:
        """Cells along y."""
        return int(self.cells.shape[0])

    @cached_property
    def forbidden(self) -> NDArray[np.uint8]:
        """The moves out of each cell that rules of the road forbid: uint8 [height, width].

        Bits 0 to 7 are the moves +x, +y, -x, -y, +x+y, -x+y, -x-y, +x-y. Empty without rules.
        """
        return NO_RULES if self.composed is None else self.composed.forbidden

    @cached_property
    def digest(self) -> str:
        """Twelve hex digits that identify the map: cells, rules, resolution, origin and frame."""
        # An OccupancyGrid holds a float32; this keeps the digest equal before and after a message.
        resolution = float(np.float32(self.resolution))
        header = f'{self.cells.shape} {resolution!r} {tuple(self.origin)!r} {self.frame_id}'
        digest = hashlib.sha256(header.encode())
        digest.update(self.cells.data)  # as it lies in memory: 0.6 ms a million cells
        digest.update(self.forbidden.tobytes())
        return digest.hexdigest()[:12]

    @property
    def layout(self) -> tuple[tuple[int, ...], float, Pose2D, str]:
        """Where the cells are: equal for maps whose cells are at the same places."""
        return self.cells.shape, self.resolution, self.origin, self.frame_id

    def is_equal_to(self, other: GridMap) -> bool:
        """Tell whether both maps have the same cells and rules: faster than digests."""
        return (
            self.layout == other.layout
            and np.array_equal(self.cells, other.cells)
            and np.array_equal(self.forbidden, other.forbidden)
        )

    def contains(self, cell: tuple[int, int]) -> bool:
        """Tell whether the cell (x, y) lies on the map."""
        height, width = self.cells.shape
        return bool(0 <= cell[0] < width and 0 <= cell[1] < height)

    def blocked(
        self, occupied_threshold: int = 65, *, allow_unknown: bool = True
    ) -> NDArray[np.bool_]:
        """Return the blocked cells: bool [height, width].

        Blocked are cells from `occupied_threshold` up, and unknown ones unless `allow_unknown`.
        """
        blocked: NDArray[np.bool_] = self.cells >= occupied_threshold
        return blocked if allow_unknown else blocked | (self.cells < FREE)

    def world_to_grid(self, points: ArrayLike) -> NDArray[np.float64]:
        """Turn points [n, 2] in metres into grid coordinates, where cell centres are integers."""
        offset = np.asarray(points, dtype=np.float64).reshape(-1, 2) - self.origin[:2]
        cos, sin = math.cos(self.origin.yaw), math.sin(self.origin.yaw)
        local: NDArray[np.float64] = offset @ np.array([[cos, -sin], [sin, cos]])
        return local / self.resolution - 0.5

    def grid_to_world(self, points: ArrayLike) -> NDArray[np.float64]:
        """Turn grid coordinates [n, 2], where cell centres are integers, into metres."""
        local = (np.asarray(points, dtype=np.float64).reshape(-1, 2) + 0.5) * self.resolution
        return self.origin.transform(local)

    def world_to_cell(self, x: float, y: float) -> tuple[int, int]:
        """Return the cell (x, y) of a point in metres, on the map or off it.

        A point on a border, within a millionth of a cell, belongs to the higher cell.
        Raises GridMapError where the point is not finite.
        """
        if not (math.isfinite(x) and math.isfinite(y)):
            raise GridMapError('point', f'({x}, {y}) is not finite')
        ((column, row),) = self.world_to_cells([[x, y]]).tolist()
        return column, row

    def world_to_cells(self, points: ArrayLike) -> NDArray[np.int64]:
        """Return the cells (x, y) [n, 2] of points [n, 2] in metres, each as `world_to_cell` does.

        Raises GridMapError where a point is not finite.
        """
        places = np.asarray(points, dtype=np.float64).reshape(-1, 2)
        if not np.isfinite(places).all():
            raise GridMapError('points', 'hold a number that is not finite')
        grid = self.world_to_grid(places.clip(-FAR, FAR)) + 0.5 + BORDER_TOLERANCE
        return np.floor(grid).astype(np.int64)


def is_occupancy(cells: NDArray[Any]) -> bool:
    """Tell whether values are occupancies: -1 for unknown, else 0 to 100."""
    return bool(cells.min() >= UNKNOWN and cells.max() <= OCCUPIED)
