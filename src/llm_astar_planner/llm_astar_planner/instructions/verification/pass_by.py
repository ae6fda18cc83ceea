# Copyright 2026 The LLM-A* for ROS 2 contributors
# SPDX-License-Identifier: Apache-2.0

"""pass: where the path crosses the rays from an object to its sides."""

from itertools import pairwise

import numpy as np
import shapely
from numpy.typing import NDArray

from llm_astar_planner.instructions.clauses.pass_by import Pass
from llm_astar_planner.instructions.outcome import ClauseOutcome, as_length, broken, kept
from llm_astar_planner.instructions.verification.geometry import EDGE, Area, Polyline, total
from llm_astar_planner.instructions.verification.measurement import Measurement
from llm_astar_planner.instructions.verification.regions import NO_AREA, RegionError

Vector = NDArray[np.float64]


def check(measurement: Measurement, clause: Pass, _: int) -> ClauseOutcome:
    """Judge where the drive crosses the rays from an object to a side and its opposite."""
    region = measurement.sized(clause.region).area
    if region.wall_distance > 0.0:
        raise RegionError(NO_AREA)
    drive, ahead = measurement.drive, measurement.regions.direction(clause.side)
    centre: Vector = shapely.get_coordinates(shapely.centroid(region.outline))[0]
    right = crossings(drive, centre, ahead, touching=False)
    wrong = crossings(drive, centre, -ahead, touching=True)
    inside = region.shrunk(EDGE).spans(drive)
    metres, where = total(inside), measurement.start
    if metres > EDGE:
        where = drive.point(float(inside[0, 0]))
        through = measurement.place_text(float(inside[0, 0]))
        detail = f'{as_length(metres)} through it, from {through}'
    elif wrong:
        where = drive.point(wrong[0])
        detail = f'passed on the other side, at {measurement.place_text(wrong[0])}'
    elif right:
        return kept(clause, f'passed at {measurement.place_text(right[0])}')
    else:
        detail = 'not passed on this side'
    is_open = any(place < measurement.begin for place in right)
    impossible = measurement.reference.small_enough and not is_open
    impossible = impossible and cannot_pass(measurement, region, centre, ahead)
    return broken(clause, detail, metres, where, impossible=impossible)


def crossings(path: Polyline, origin: Vector, ahead: Vector, *, touching: bool) -> list[float]:
    """Return the places where a path crosses a ray, from one side of it to the other.

    With `touching` also where it comes to the ray and leaves it on the same side, which is no
    crossing. A path that runs along the ray's line between leaving its two sides crosses where
    all of that stretch is on the ray, or, with `touching`, where any of it is. Where the path
    begins or ends on the ray it neither crosses nor touches it.
    """
    off = path.corners - origin
    across = ahead[0] * off[:, 1] - ahead[1] * off[:, 0]
    along = off @ ahead
    beside = np.flatnonzero(np.abs(across) > EDGE)
    found = []
    for before, after in pairwise(beside):
        is_change = across[before] * across[after] < 0.0
        if after > before + 1:
            on_ray = along[before + 1 : after] > 0.0
            met = on_ray.any() if touching else is_change and on_ray.all()
            place = path.at[before + 1]
        elif is_change:
            share = across[before] / (across[before] - across[after])
            met = along[before] + share * (along[after] - along[before]) > 0.0
            place = path.at[before] + share * (path.at[after] - path.at[before])
        else:
            continue
        if met:
            found.append(float(place))
    return found


def cannot_pass(measurement: Measurement, region: Area, centre: Vector, ahead: Vector) -> bool:
    """Tell whether no path passes the object on the side.

    Every one crosses the object or the ray to the opposite side, or none the ray to the side.
    """
    reference, grid_map = measurement.reference, measurement.route.costmap.grid_map
    origin, beyond = grid_map.world_to_grid([centre, centre - ahead])
    step = beyond - origin
    line = np.concatenate((origin, step / np.hypot(*step)))
    reached = reference.reach(reference.inside(region.shrunk(EDGE)), line) > 0
    if not (reached & reference.goal_mask).any():
        return True
    far = centre + ahead * measurement.regions.map_outline.length
    ray = shapely.LineString([centre, far])
    return not (reached & reference.near(ray)).any()
