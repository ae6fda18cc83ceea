"""Tasks of bags: every request a sample on the map of its moment, numbered over all bags."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field, replace

import numpy as np
from llm_astar_msgs_adapter.bags.reading import Bag
from llm_astar_msgs_adapter.maps.barrier_map import BarrierMap, Sample
from llm_astar_msgs_adapter.maps.grid_dataset import GridProblem
from llm_astar_msgs_adapter.maps.grid_map import GridMap, GridMapError, Pose2D

from llm_astar_planner.benchmark.bags.pending_requests import BagRequest
from llm_astar_planner.benchmark.bags.recorded_plans import Occasion
from llm_astar_planner.benchmark.bags.request_list import ListedRequest
from llm_astar_planner.benchmark.bags.requests import RequestReader
from llm_astar_planner.benchmark.bags.topics import Wanted
from llm_astar_planner.benchmark.datasets.samples import BenchmarkSample, ProblemMap
from llm_astar_planner.benchmark.results import RowKey
from llm_astar_planner.benchmark.runner.engine import SearchSettings, Task, list_variants
from llm_astar_planner.benchmark.runner.sources import SourceSpec
from llm_astar_planner.search.result import Cell

# What a report may show: so many maps, cells of them all, and requests on each.
MAX_MAPS, MAX_CELLS, MAX_REQUESTS = 100, 4_000_000, 100


@dataclass(frozen=True)
class BagSweep:
    """What an evaluation of bags covers.

    `window` is how many seconds a recorded plan may take.
    """

    bags: Sequence[Bag]
    wanted: Wanted
    methods: Sequence[str]
    sources: Sequence[SourceSpec]
    settings: SearchSettings
    window: float = 10.0
    listed: Sequence[ListedRequest] = ()


@dataclass
class Numbers:
    """Numbers maps by what they hold and requests on each map, the same for the same bags.

    A map that a dataset names keeps its id where it is free, a sample of it its place.
    """

    _maps: dict[str, int] = field(default_factory=dict)
    _used: set[int] = field(default_factory=set)
    _samples: dict[int, set[int]] = field(default_factory=dict)
    _others: dict[int, range] = field(default_factory=dict)

    def map(self, digest: str, wanted: int | None) -> int:
        """Return the number of a map."""
        if digest not in self._maps:
            number = wanted if wanted is not None and wanted not in self._used else None
            if number is None:
                number = max(self._used, default=-1) + 1
            self._maps[digest] = number
            self._used.add(number)
        return self._maps[digest]

    def pair(self, number: int, wanted: int | None, reserved: int) -> int:
        """Return the number of a request on a map; the first `reserved` are its samples'."""
        samples = self._samples.setdefault(number, set())
        others = self._others.setdefault(number, range(reserved, reserved))
        if wanted is not None and wanted not in samples and wanted not in others:
            samples.add(wanted)
            return wanted
        self._others[number] = range(others.start, others.stop + 1)
        return others.stop


class KeptMaps:
    """The first maps of an evaluation with their requests, for the report to draw."""

    def __init__(self) -> None:
        """Keep none yet."""
        self._maps: dict[int, ProblemMap] = {}

    def add(self, sample: BenchmarkSample) -> None:
        """Keep a request's map, if there is room, and the request, if it is the map's next."""
        number = sample.barrier_map.id
        known = self._maps.get(number, sample.barrier_map)
        cells = sum(_cells(item) for item in self._maps.values())
        full = len(self._maps) >= MAX_MAPS or cells + _cells(known) > MAX_CELLS
        if number not in self._maps and full:
            return
        if len(known.samples) == sample.pair < MAX_REQUESTS:
            known = replace(known, samples=(*known.samples, sample.sample))
        self._maps[number] = known

    def maps(self) -> list[ProblemMap]:
        """Return the maps kept, by number."""
        return [self._maps[number] for number in sorted(self._maps)]


class BagRun:
    """Tasks of bags as they are read, and the maps kept of them."""

    def __init__(self, sweep: BagSweep) -> None:
        """Take what to cover; nothing is read yet."""
        self._sweep = sweep
        self._variants = list_variants(sweep.methods, sweep.sources)
        self._numbers = Numbers()
        self.kept = KeptMaps()

    def tasks(self, done: frozenset[RowKey]) -> Iterator[Task]:
        """Yield the tasks that are not `done`, bag after bag."""
        for bag in self._sweep.bags:
            yield from self._tasks_of(bag, done)

    def _tasks_of(self, bag: Bag, done: frozenset[RowKey]) -> Iterator[Task]:
        sweep = self._sweep
        reader = RequestReader(bag, sweep.wanted, sweep.window, sweep.listed)
        for request in reader.requests():
            try:
                task = self._task(bag, request)
            except GridMapError as error:
                place = f'{bag.path}: request {request.index}'
                bag.problems.leave_out(f'{place}: {error}', f'{bag.path}: requests left out')
                continue
            left = tuple(
                (variant, index)
                for variant, index in self._variants
                if (*task.sample.key, 1, variant) not in done
            )
            if left:
                yield replace(task, variants=left)

    def _task(self, bag: Bag, request: BagRequest) -> Task:
        sweep = self._sweep
        grid_map = request.grid_map
        ends = _cell(grid_map, request.start), _cell(grid_map, request.goal)
        sample, is_sample = self._sample(request, ends)
        settings = sweep.settings
        if request.tolerance > 0.0:
            settings = replace(settings, tolerance=request.tolerance)
        self.kept.add(sample)
        return Task(
            sample, 1, (), tuple(sweep.sources), settings, _occasion(bag, request), is_sample
        )

    def _sample(
        self, request: BagRequest, ends: tuple[Cell, Cell]
    ) -> tuple[BenchmarkSample, bool]:
        """Return a request with its number, and whether it is a sample of a dataset's own."""
        barriers, grid_map = request.barrier_map, request.grid_map
        if barriers is None:
            number = self._numbers.map(grid_map.digest, None)
            pair = self._numbers.pair(number, None, 0)
            return BenchmarkSample(GridProblem(number, grid_map), pair, Sample(*ends)), False
        number = self._numbers.map(grid_map.digest, barriers.id)
        corner = barriers.range_x[0], barriers.range_y[0]
        start, goal = ((x + corner[0], y + corner[1]) for x, y in ends)
        own = next((n for n, s in enumerate(barriers.samples) if s[:2] == (start, goal)), None)
        pair = self._numbers.pair(number, own, len(barriers.samples))
        sample = Sample(start, goal) if own is None else barriers.samples[own]
        bare = replace(barriers, id=number, samples=())
        return BenchmarkSample(bare, pair, sample), pair == own and number == barriers.id


def _cell(grid_map: GridMap, pose: Pose2D) -> Cell:
    return grid_map.world_to_cell(pose.x, pose.y)


def _cells(problem: ProblemMap) -> int:
    if isinstance(problem, BarrierMap):
        return int(np.ptp(problem.range_x) * np.ptp(problem.range_y))
    return problem.grid_map.cells.size


def _occasion(bag: Bag, request: BagRequest) -> Occasion:
    grid_map, recorded = request.grid_map, request.recorded
    points = None if recorded.points is None else grid_map.world_to_grid(recorded.points)
    waypoints = grid_map.world_to_grid(recorded.waypoints).round(6).tolist()
    return Occasion(
        bag.name,
        request.index,
        request.time,
        grid_map.digest,
        None if points is None else points.round(6),
        recorded.code,
        tuple((x, y) for x, y in waypoints),
    )
