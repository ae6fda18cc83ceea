"""Measure what a zone costs on a large map: CPU milliseconds to compose it and to prepare the map.

Preparing in increments and from nothing take turns, so that other load on the machine slows both
alike; the medians count. Run it with `python -m benchmarks.zones`.
"""

from __future__ import annotations

import argparse
import time
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
import shapely
from llm_astar_msgs_adapter.maps.grid_map import OCCUPIED, GridMap
from llm_astar_planner.costmap.config import CostmapConfig
from llm_astar_planner.costmap.costmap import Costmap
from llm_astar_planner.costmap.zone_layer import ZoneLayer
from llm_astar_planner.costmap.zones import Zone

SIZE, RESOLUTION = 2000, 0.05
ROUNDS = 9
CONFIGS = (CostmapConfig(), CostmapConfig(robot_radius=0.2, inflation_radius=0.55))


class ZoneTimes(NamedTuple):
    """CPU milliseconds: the zone onto the map, and the map prepared in increments and whole."""

    compose: float
    increments: float
    whole: float


def boxes_map(size: int) -> GridMap:
    """Return a map of so many cells a side with a box for each 10,000 cells."""
    random = np.random.default_rng(0)
    cells = np.zeros((size, size), dtype=np.int8)
    for _ in range(size**2 // 10_000):
        x, y, width, height = *random.integers(0, size, 2), *random.integers(5, 40, 2)
        cells[y : y + height, x : x + width] = OCCUPIED
    return GridMap(cells, RESOLUTION)


def measure(size: int, config: CostmapConfig, rounds: int) -> ZoneTimes:
    """Return the median times of a zone of 2 m x 1 m, in another place each round."""
    grid_map = boxes_map(size)
    previous = Costmap(grid_map, config)
    previous.prepare()
    times = []
    for number in range(rounds + 1):
        x = number * size * RESOLUTION / (rounds + 2)
        zone = Zone('zone', shapely.box(x, 1.0, x + 2.0, 2.0))
        began = time.thread_time()
        zoned = ZoneLayer(grid_map, [zone], config=config).compose(grid_map)
        composed = time.thread_time()
        Costmap(zoned, config, previous=previous).prepare()
        updated = time.thread_time()
        Costmap(zoned, config).prepare()
        times.append((composed - began, updated - composed, time.thread_time() - updated))
    # The first round compiles.
    return ZoneTimes(*(1000.0 * np.median(times[1:], axis=0)).tolist())


def main(arguments: Sequence[str] | None = None) -> None:
    """Print a line for each configuration."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument(
        '--size', type=int, default=SIZE, help='cells a side, %(default)s by default'
    )
    parser.add_argument('--rounds', type=int, default=ROUNDS, help='%(default)s by default')
    options = parser.parse_args(arguments)
    for config in CONFIGS:
        times = measure(options.size, config, options.rounds)
        print(
            f'robot_radius {config.robot_radius:g}: compose {times.compose:.1f} ms, prepare '
            f'{times.increments:.1f} ms in increments, {times.whole:.1f} ms whole'
        )


if __name__ == '__main__':
    main()
