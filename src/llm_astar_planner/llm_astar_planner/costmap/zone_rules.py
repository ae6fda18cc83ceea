# Copyright 2026 The LLM-A* for ROS 2 contributors
# SPDX-License-Identifier: Apache-2.0

"""Which moves the rules of the road forbid: against a one-way, or on the left of a lane.

A move is forbidden where its direction has a part against the heading of the cell where it begins
or ends. From one half of a lane to the other, whose headings are opposite, the moves nearest to
straight across are made, so that a lane may be crossed at any angle.
"""

import math

import numpy as np
import shapely
from llm_astar_msgs_adapter.maps.grid_map import GridMap
from numpy.typing import NDArray

from llm_astar_planner.costmap.raster import Window, cover_window
from llm_astar_planner.costmap.zones import KEEP_RIGHT, Zone, ZonesError
from llm_astar_planner.search.grid_graph import STEPS

# Parts against a heading up to this are rounding.
ROUNDING = 1e-9
# Moves up to 22.5 degrees off straight across cross a lane: one of the eight always does.
ACROSS = math.sin(math.pi / 8.0) + ROUNDING
# Cells of lines, each of which takes microseconds.
MOST_CELLS = 1_000_000


def forbidden_moves(
    zone: Zone, window: Window, layout: GridMap
) -> tuple[tuple[slice, slice], NDArray[np.uint8]]:
    """Return a part of a map, and the moves out of its cells that a zone forbids, as bits.

    `window` holds the zone; the part has the cells beside it too. Raises ZonesError for lines that
    touch too many cells.
    """
    (top, bottom, left, right), (height, width) = window, layout.cells.shape
    around = Window(
        max(top - 1, 0), min(bottom + 1, height), max(left - 1, 0), min(right + 1, width)
    )
    touched = cover_window(zone.area, layout, around).touched
    angles, is_left = headings(zone, touched, around, layout)
    angles[~touched] = math.nan
    found = np.zeros(angles.shape, dtype=np.uint8)
    for bit, (x, y) in enumerate(STEPS):
        along = np.cos(angles - math.atan2(y, x))
        ahead, left_ahead = (
            np.roll(np.pad(part, 1), (-y, -x), (0, 1))[1:-1, 1:-1] for part in (along, is_left)
        )
        crosses = (is_left != left_ahead) & (abs(along) <= ACROSS) & ~np.isnan(ahead)
        against = (along < -ROUNDING) | (ahead < -ROUNDING)
        found |= (against & ~crosses).astype(np.uint8) << bit
    return around.slices(), found


def headings(
    zone: Zone, touched: NDArray[np.bool_], window: Window, layout: GridMap
) -> tuple[NDArray[np.float64], NDArray[np.bool_]]:
    """Return the headings of cells touched in a window, in radians of the grid; the left half.

    A cell has that of the part of the lines which is nearest to it; left of a keep_right lane it
    has the opposite one. Of a polygon all have the same.
    """
    angles, is_left = np.zeros(touched.shape), np.zeros_like(touched)
    if not zone.is_line:
        return angles + math.radians(zone.heading) - layout.origin.yaw, is_left
    y, x = np.nonzero(touched)
    if len(x) > MOST_CELLS:
        raise ZonesError(f'zone {zone.label}: its lines touch over {MOST_CELLS:,} cells')
    places = layout.grid_to_world(np.column_stack([x + window.left, y + window.top]))
    lines = shapely.get_parts(shapely.remove_repeated_points(zone.geometry))
    points, line = shapely.get_coordinates(lines, return_index=True)
    joins = line[1:] == line[:-1]
    begins, ends, line = points[:-1][joins], points[1:][joins], line[1:][joins]
    parts, steps = shapely.linestrings(np.stack([begins, ends], axis=1)), ends - begins
    cells, numbers = shapely.STRtree(parts).query_nearest(shapely.points(places))
    # At a bend, where two are nearest, the part before it counts.
    order = np.lexsort((numbers, cells))
    numbers = numbers[order][np.unique(cells[order], return_index=True)[1]]
    # What is beyond the end of a part is left of the line where it is left of the bend.
    turned = steps / np.hypot(*steps.T)[:, None]
    turned[:-1] += np.where(line[1:] == line[:-1], turned[1:].T, turned[:-1].T).T
    step, aside = steps[numbers], places - ends[numbers]
    is_beyond = (aside * step).sum(axis=1) > 0.0
    ahead = np.where(is_beyond, turned[numbers].T, step.T)
    if zone.kind == KEEP_RIGHT:
        is_left[y, x] = ahead[0] * aside[:, 1] - ahead[1] * aside[:, 0] > ROUNDING
    angles[y, x] = np.arctan2(step[:, 1], step[:, 0]) - layout.origin.yaw
    return angles + math.pi * is_left, is_left
