# Copyright 2026 The LLM-A* for ROS 2 contributors
# SPDX-License-Identifier: Apache-2.0

"""What a running graph shows to the page: its newest map, plan and state."""

import asyncio
import json
from collections.abc import AsyncIterator, Iterable
from functools import partial
from itertools import count
from typing import Any

import numpy as np
from llm_astar_msgs_adapter.maps.grid_map import GridMap
from llm_astar_msgs_adapter.maps.places import NO_PLACES, Places
from llm_astar_planner.costmap.zones import Zone
from llm_astar_planner.planning.types import Why
from llm_astar_planner.search.arrays import Float64s

from llm_astar_lab.play.encoding import causes_json, grid_json, rules_json
from llm_astar_lab.play.maps import MAX_CELLS, PlayError

# Seconds between two looks at what is new, and between two signs of life.
PERIOD_S = 0.1
KEEP_ALIVE_S = 10.0
# Pages that may watch at once.
MAX_PAGES = 8
MAX_POINTS = 1_000_000


class LiveFeed:
    """Keeps what a graph showed last; pages follow it. Thread-safe."""

    def __init__(self) -> None:
        """Start with nothing but the state."""
        self._changes = count()
        # By its name what came last, with a number that each gets when it comes. Threads replace
        # values as a whole, so they need no lock.
        self._shown: dict[str, tuple[int, Any]] = {}
        self.show_status('waiting for the planner')
        self.show_places(NO_PLACES)
        self._pages = 0
        self._is_closed = False

    def show_map(self, grid_map: GridMap) -> None:
        """Take a newer map."""
        if grid_map.cells.size > MAX_CELLS:
            size = f'{grid_map.width} x {grid_map.height}'
            self.show_status(f'the map has {size} cells, over the {MAX_CELLS} that can be shown')
        else:
            self._shown['map'] = next(self._changes), grid_map

    def show_places(self, places: Places) -> None:
        """Take newer places."""
        self._shown['places'] = next(self._changes), places

    def show_zones(self, zones: Iterable[Zone]) -> None:
        """Take newer zones and rules of the road."""
        self._shown['zones'] = next(self._changes), tuple(zones)

    def show_plan(self, points: Float64s, report: dict[str, Any]) -> None:
        """Take a newer plan: its points [n, 2] in metres, the fields of its PlanReport."""
        self._shown['plan'] = next(self._changes), (points, report)

    def show_status(self, sentence: str) -> None:
        """Take a newer sentence on the planner's state."""
        self._shown['status'] = next(self._changes), sentence

    def close(self) -> None:
        """End the streams of all pages."""
        self._is_closed = True

    def follow(self) -> AsyncIterator[str]:
        """Return server-sent events: what there is now, then what is new; until closed.

        Raises PlayError (503) where too many pages watch already.
        """
        if self._pages >= MAX_PAGES:
            raise PlayError(f'{MAX_PAGES} pages watch already; close one', status=503)
        return self._events()

    async def _events(self) -> AsyncIterator[str]:
        self._pages += 1
        try:
            sent: dict[str, object] = {}
            silent = 0.0
            while not self._is_closed:
                fresh = self._newer_than(sent)
                silent = 0.0 if fresh else silent + PERIOD_S
                for kind, value in fresh:
                    yield f'event: {kind}\ndata: {json.dumps(value, allow_nan=False)}\n\n'
                if silent >= KEEP_ALIVE_S:
                    silent = 0.0
                    yield ': still here\n\n'
                await asyncio.sleep(PERIOD_S)
        finally:
            self._pages -= 1

    def _newer_than(self, sent: dict[str, object]) -> list[tuple[str, dict[str, Any]]]:
        """Return the events not sent yet, the map before the plan, and note them in `sent`."""
        shown = dict(self._shown)
        number, sentence = shown['status']
        make: dict[str, tuple[object, Any]] = {'status': (number, lambda: {'message': sentence})}
        if 'map' in shown:
            (number, grid_map), (of_places, places) = shown['map'], shown['places']
            make['map'] = (number, of_places), partial(live_map_json, grid_map, places)
        if 'map' in shown and 'zones' in shown:
            number, zones = shown['zones']
            make['rules'] = (number, grid_map.layout), partial(rules_json, zones, grid_map)
        if 'map' in shown and 'plan' in shown:
            # Cells of a path are those of a layout of the map.
            number, (points, report) = shown['plan']
            key = number, grid_map.layout
            make['plan'] = key, partial(readable_plan_json, points, report, grid_map)
        fresh = [kind for kind, (key, _) in make.items() if sent.get(kind) != key]
        sent.update((kind, make[kind][0]) for kind in fresh)
        return [(kind, make[kind][1]()) for kind in fresh]


def live_map_json(grid_map: GridMap, places: Places) -> dict[str, Any]:
    """Return a graph's map with its places as the page takes every map."""
    name = f'map of the graph, frame {grid_map.frame_id}'
    names = {'id': 'live', 'name': name, 'unit': 'm', 'offset': [0, 0], 'pairs': []}
    return grid_json(grid_map, places) | names


def readable_plan_json(
    points: Float64s, report: dict[str, Any], grid_map: GridMap
) -> dict[str, Any]:
    """Return a graph's plan as `live_plan_json` does, or that it cannot be read."""
    try:
        plan = live_plan_json(points, report, grid_map)
        json.dumps(plan, allow_nan=False)
    except (LookupError, TypeError, ValueError, ArithmeticError, AttributeError) as error:
        message = f'the plan of the graph cannot be read: {type(error).__name__}: {error}'
        return {
            'role': 'live', 'found': False, 'code_name': 'UNREADABLE', 'message': message[:400],
        }  # fmt: skip
    return plan


def live_plan_json(points: Float64s, report: dict[str, Any], grid_map: GridMap) -> dict[str, Any]:
    """Return a graph's plan as the page takes every plan, in cells of the map."""
    if not np.isfinite(points).all() or len(points) > MAX_POINTS:
        raise ValueError(f'a path of {len(points)} points, or with one that is not finite')
    places = grid_map.world_to_grid([(x, y) for x, y, _ in report['waypoints']]).round(3).tolist()
    waypoints = [(x, y, status) for (x, y), (*_, status) in zip(places, report['waypoints'])]
    metres, why = report['length'], report['why']
    cells = None if metres is None else metres / grid_map.resolution
    return report | {
        'found': report['code'] == 0, 'role': 'live', 'length': cells, 'length_m': metres,
        'waypoints': waypoints, 'title': f'{report["method"]}, waypoints by {report["guided_by"]}',
        'path': np.rint(grid_map.world_to_grid(points)).astype(int).tolist(), 'via': [],
        'causes': causes_json(why and Why(**why, cell=None, reached=0), grid_map),
    }  # fmt: skip
