# Copyright 2026 The LLM-A* for ROS 2 contributors
# SPDX-License-Identifier: Apache-2.0

"""Start-goal pairs on a grid map: the counterpart of BarrierMap for maps without barriers."""

from __future__ import annotations

import base64
import binascii
import hashlib
import math
import zlib
from collections.abc import Mapping
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

import numpy as np

from llm_astar_msgs_adapter.errors import LlmAstarError, shortened
from llm_astar_msgs_adapter.maps.barrier_map import Point, Sample, check_scale, parse_family
from llm_astar_msgs_adapter.maps.grid_map import MAX_CELLS, ORIGIN, GridMap, GridMapError, Pose2D


class GridProblemError(LlmAstarError, ValueError):
    """A grid problem that cannot be used; the message names the field."""


@dataclass(frozen=True, eq=False)
class GridProblem:
    """A grid map and start-goal pairs on it, in cells. It has the methods of BarrierMap.

    `optimal_lengths` are the lengths (in cells) published for the samples: NaN for a sample
    without one, empty where there are none. `family` names the kind of map, '' if unknown.
    Problems with equal contents are equal.
    """

    id: int
    grid_map: GridMap
    samples: tuple[Sample, ...] = ()
    optimal_lengths: tuple[float, ...] = ()
    family: str = ''

    @cached_property
    def digest(self) -> str:
        """Twelve hex digits that identify the contents: map, samples, lengths and family."""
        rest = f'{self.id} {self.grid_map.digest} {self.samples!r} {self.optimal_lengths!r}'
        rest += f' {self.family}' if self.family else ''
        return hashlib.sha256(rest.encode()).hexdigest()[:12]

    def __eq__(self, other: object) -> bool:
        return isinstance(other, GridProblem) and self.digest == other.digest

    def __hash__(self) -> int:
        return hash(self.digest)

    def to_grid(self) -> GridMap:
        """Return the grid."""
        return self.grid_map

    @property
    def offset(self) -> Point:
        """The coordinates of cell (0, 0), which samples name as it is: (0, 0)."""
        return 0, 0

    def to_cell(self, point: Point) -> Point:
        """Return the cell of a sample's point: the point itself."""
        return point

    def scale(self, factor: int) -> GridProblem:
        """Divide each cell into `factor` x `factor` cells, on a map of the same size in metres.

        Samples are at the middle of their former cells. The lengths are dropped, since a finer map
        has other shortest paths. Raises GridProblemError for less than 1 and for too many cells.
        """
        check_scale(factor, self.grid_map.cells.size, self.id, GridProblemError)
        if factor == 1:
            return self
        cells = self.grid_map.cells.repeat(factor, axis=0).repeat(factor, axis=1)
        finer = replace(self.grid_map, cells=cells, resolution=self.grid_map.resolution / factor)

        def middle(point: Point) -> Point:
            return point[0] * factor + factor // 2, point[1] * factor + factor // 2

        samples = tuple(Sample(middle(item.start), middle(item.goal)) for item in self.samples)
        return GridProblem(self.id, finer, samples, family=self.family)

    def to_json(self) -> dict[str, Any]:
        """Return a JSON object that `parse_grid_problem` reads; the cells are compressed."""
        lengths = [None if math.isnan(length) else length for length in self.optimal_lengths]
        return {
            'id': self.id, 'width': self.grid_map.width, 'height': self.grid_map.height,
            'resolution': self.grid_map.resolution, 'origin': list(self.grid_map.origin),
            'frame_id': self.grid_map.frame_id,
            'cells': base64.b64encode(zlib.compress(self.grid_map.cells.tobytes())).decode(),
            'start_goal': [[list(sample.start), list(sample.goal)] for sample in self.samples],
            'optimal_lengths': lengths, **({'family': self.family} if self.family else {}),
        }  # fmt: skip


def is_grid_problem(entry: object) -> bool:
    """Tell whether a JSON object is a grid problem rather than a barrier map."""
    return isinstance(entry, dict) and 'cells' in entry


def parse_grid_problem(entry: dict[str, Any], where: str = 'grid problem') -> GridProblem:
    """Read what `to_json` wrote. Raises GridProblemError that begins with `where`."""
    try:
        count = cell_count(entry, where)
        packed = base64.b64decode(entry['cells'], validate=True)
        # Takes no more memory than the cells.
        data = zlib.decompressobj().decompress(packed, count + 1)
        cells = np.frombuffer(data, dtype=np.int8).reshape(entry['height'], entry['width'])
        origin = Pose2D(*entry.get('origin', ORIGIN))
        return GridProblem(
            int(entry['id']),
            GridMap(cells, entry['resolution'], origin, entry['frame_id']),
            tuple(
                Sample((int(x0), int(y0)), (int(x1), int(y1)))
                for (x0, y0), (x1, y1) in entry['start_goal']
            ),
            tuple(math.nan if item is None else float(item) for item in entry['optimal_lengths']),
            parse_family(entry, 'family'),
        )
    except KeyError as error:
        raise GridProblemError(f'{where}: {error.args[0]}: is missing') from None
    except (binascii.Error, zlib.error) as error:
        raise GridProblemError(f'{where}: cells: {error}') from None
    except (GridMapError, TypeError, ValueError, OverflowError, AttributeError) as error:
        raise GridProblemError(f'{where}: {shortened(str(error))}') from None


def cell_count(entry: Mapping[str, Any], where: str) -> int:
    """Return how many cells a grid problem says it has. Raises GridProblemError."""
    count = 1
    for name in ('height', 'width'):
        side = entry.get(name)
        if type(side) is not int or not 0 < side <= MAX_CELLS:
            raise GridProblemError(f'{where}: {name}: a whole number above 0 is expected')
        count *= side
    if count > MAX_CELLS:
        raise GridProblemError(f'{where}: height, width: over {MAX_CELLS} cells')
    return count
