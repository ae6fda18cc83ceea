"""What a running graph shows to the page: its newest map, plan and state."""

from __future__ import annotations

import asyncio
import json
import threading
from collections.abc import AsyncIterator, Callable
from functools import partial
from typing import Any

import numpy as np
from llm_astar_msgs_adapter.maps.grid_map import GridMap
from llm_astar_msgs_adapter.maps.places import NO_PLACES, Places
from numpy.typing import NDArray

from llm_astar_lab.play.encoding import grid_json, place_json
from llm_astar_lab.play.errors import PlayError
from llm_astar_lab.play.maps import MAX_CELLS

# Seconds between two looks at what is new, and between two signs of life.
PERIOD_S = 0.1
KEEP_ALIVE_S = 10.0
# Pages that may watch at once.
MAX_PAGES = 8
MAX_POINTS = 1_000_000
# Figures of a report that the page shows by the names of `figures_json`.
FIGURES = {
    'expansions': 'operation',
    'bound': 'ratio',
    'turns': 'turns',
    'clearance_m': 'clearance',
}
# Fields of a report that the page lists besides.
REPORTED = (
    'source',
    'source_status',
    'map_digest',
    'map_age',
    'start_shift',
    'goal_shift',
    'footprint',
)


class LiveFeed:
    """Keeps what a graph showed last; pages follow it. Thread-safe."""

    def __init__(self) -> None:
        """Start with nothing but the state."""
        self._lock = threading.Lock()
        self._map: GridMap | None = None
        self._places = NO_PLACES
        self._plan: tuple[NDArray[np.float64], dict[str, Any]] | None = None
        self._status = 'waiting for the planner'
        # How often each has changed.
        self._numbers = {'map': 0, 'plan': 0, 'status': 1}
        self._pages = 0
        self._is_closed = False

    def show_map(self, grid_map: GridMap) -> None:
        """Take a newer map."""
        if grid_map.cells.size > MAX_CELLS:
            size = f'{grid_map.width} x {grid_map.height}'
            self.show_status(f'the map has {size} cells, over the {MAX_CELLS} that can be shown')
            return
        with self._lock:
            self._map = grid_map
            self._numbers['map'] += 1

    def show_places(self, places: Places) -> None:
        """Take newer places."""
        with self._lock:
            self._places = places
            self._numbers['map'] += 1

    def show_plan(self, points: NDArray[np.float64], report: dict[str, Any]) -> None:
        """Take a newer plan: its points [n, 2] in metres, the fields of its PlanReport."""
        with self._lock:
            self._plan = points, report
            self._numbers['plan'] += 1

    def show_status(self, sentence: str) -> None:
        """Take a newer sentence on the planner's state."""
        with self._lock:
            self._status = sentence
            self._numbers['status'] += 1

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
        with self._lock:
            grid_map, places = self._map, self._places
            plan, status = self._plan, self._status
            numbers: dict[str, object] = dict(self._numbers)
        make: dict[str, Callable[[], dict[str, Any]]] = {'status': lambda: {'message': status}}
        if grid_map is not None:
            make['map'] = partial(live_map_json, grid_map, places)
        if grid_map is not None and plan is not None:
            # Cells of a path are those of a layout of the map.
            numbers['plan'] = numbers['plan'], grid_map.layout
            make['plan'] = partial(readable_plan_json, *plan, grid_map)
        fresh = [kind for kind in make if sent.get(kind) != numbers[kind]]
        sent.update((kind, numbers[kind]) for kind in fresh)
        return [(kind, make[kind]()) for kind in fresh]


def live_map_json(grid_map: GridMap, places: Places) -> dict[str, Any]:
    """Return a graph's map with its places as the page takes every map."""
    return grid_json(grid_map) | {
        'id': 'live',
        'name': f'map of the graph, frame {grid_map.frame_id}',
        'unit': 'm',
        'offset': [0, 0],
        'pairs': [],
        'places': [place_json(place, grid_map) for place in places],
    }


def readable_plan_json(
    points: NDArray[np.float64], report: dict[str, Any], grid_map: GridMap
) -> dict[str, Any]:
    """Return a graph's plan as `live_plan_json` does, or that it cannot be read."""
    try:
        plan = live_plan_json(points, report, grid_map)
        json.dumps(plan, allow_nan=False)
    except (LookupError, TypeError, ValueError, ArithmeticError, AttributeError) as error:
        message = f'the plan of the graph cannot be read: {type(error).__name__}: {error}'
        return {'role': 'live', 'found': False, 'code': 'UNREADABLE', 'message': message[:400]}
    return plan


def live_plan_json(
    points: NDArray[np.float64], report: dict[str, Any], grid_map: GridMap
) -> dict[str, Any]:
    """Return a graph's plan as the page takes every plan, in cells of the map."""
    if not np.isfinite(points).all() or len(points) > MAX_POINTS:
        raise ValueError(f'a path of {len(points)} points, or with one that is not finite')
    path = np.rint(grid_map.world_to_grid(points)).astype(int).tolist()
    waypoints = report['waypoints']
    places = grid_map.world_to_grid([(x, y) for x, y, _ in waypoints]).round(3).tolist()
    figures = live_figures_json(report, grid_map.resolution)
    return {
        'role': 'live',
        'title': f'{report["method"]}, waypoints by {report["guided_by"]}',
        'found': report['code'] == 0,
        'code': report['code_name'],
        'message': report['message'],
        'warnings': list(report['warnings']),
        'path': path,
        'waypoints': [
            {'number': number, 'x': x, 'y': y, 'status': status}
            for number, ((x, y), (*_, status)) in enumerate(zip(places, waypoints), start=1)
        ],
        'via': [],
        'figures': figures,
        'report': figures | {name: report[name] for name in REPORTED},
        'instruction': live_instruction_json(report['instruction_report']),
    }


def live_figures_json(report: dict[str, Any], resolution: float) -> dict[str, Any]:
    """Return the figures of a report: lengths in cells and metres, times in milliseconds."""
    length = report['length']
    return {name: report[field] for name, field in FIGURES.items()} | {
        'length_m': length,
        'length': None if length is None else length / resolution,
        'search_ms': 1000.0 * report['seconds_search'],
        'source_ms': 1000.0 * report['seconds_source'],
    }


def live_instruction_json(outcome: dict[str, Any] | None) -> dict[str, Any] | None:
    """Return what became of the graph's instruction, clause by clause."""
    if outcome is None:
        return None
    read = outcome.get('interpretation', {})
    return {
        'sentence': str(read.get('sentence', '')),
        'status': str(read.get('status', '')),
        'clauses': [
            {key: str(clause.get(key, '')) for key in ('clause', 'status', 'detail')}
            for clause in outcome.get('clauses', [])
        ],
        'note': str(outcome.get('note', '')),
    }
