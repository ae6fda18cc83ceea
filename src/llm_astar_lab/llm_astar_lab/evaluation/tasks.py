# Copyright 2026 The LLM-A* for ROS 2 contributors
# SPDX-License-Identifier: Apache-2.0

"""Benchmark tasks from bags: each request is a sample on the map of its time."""

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field, replace

from llm_astar_msgs_adapter.maps.barrier_map import BarrierMap, Sample
from llm_astar_msgs_adapter.maps.grid_dataset import GridProblem
from llm_astar_msgs_adapter.maps.grid_map import GridMapError
from llm_astar_msgs_adapter.maps.places import NO_PLACES, Places
from llm_astar_msgs_adapter.maps.problem_maps import ProblemMap

from llm_astar_lab.bags.reading import Bag
from llm_astar_lab.datasets.named import BenchmarkSample
from llm_astar_lab.evaluation.recorded_plans import BagRequest
from llm_astar_lab.evaluation.requests import RequestReader, TopicSelection
from llm_astar_lab.results.stored_rows import Finished
from llm_astar_lab.runner.engine import SearchSettings, Task, list_variants, make_tasks
from llm_astar_lab.runner.sources import SourceSpec

# What a report may show: maps, cells on all of them together, and requests on each.
MAX_MAPS, MAX_CELLS, MAX_REQUESTS = 100, 4_000_000, 100


@dataclass
class SampleIdAllocator:
    """Numbers maps and the requests on each map over all bags; the same bags give the same ids.

    Equal maps have one id. A map of a dataset keeps its id where that is free, and a sample of
    the dataset its number.
    """

    _maps: dict[str, int] = field(default_factory=dict)
    _samples: dict[int, set[int]] = field(default_factory=dict)
    _others: dict[int, range] = field(default_factory=dict)

    def map_id(self, digest: str, preferred: int | None) -> int:
        """Return the id of a map with this digest."""
        taken = self._maps.values()
        if preferred is None or preferred in taken:
            preferred = max(taken, default=-1) + 1
        return self._maps.setdefault(digest, preferred)

    def pair(self, map_id: int, preferred: int | None, reserved: int) -> int:
        """Return the number of a request on a map; the first `reserved` are for its samples."""
        samples = self._samples.setdefault(map_id, set())
        others = self._others.setdefault(map_id, range(reserved, reserved))
        if preferred is not None and preferred not in samples and preferred not in others:
            samples.add(preferred)
            return preferred
        self._others[map_id] = range(others.start, others.stop + 1)
        return others.stop


@dataclass
class Evaluation:
    """What an evaluation of bags covers; makes its tasks while the bags are read.

    `window` is how many seconds after its request a recorded plan may come. Without an
    instruction in `settings` a request has the one that the bag recorded with its plan, on
    `places`. The first maps are kept for the report.
    """

    bags: Sequence[Bag]
    selection: TopicSelection
    methods: Sequence[str]
    sources: Sequence[SourceSpec]
    settings: SearchSettings
    window: float = 10.0
    places: Places = NO_PLACES
    _ids: SampleIdAllocator = field(default_factory=SampleIdAllocator)
    # The first maps and their requests, by map.
    _kept: dict[int, ProblemMap] = field(default_factory=dict)

    def tasks(self, done: Finished) -> Iterator[Task]:
        """Yield the tasks that are not `done`, bag after bag."""
        variants = list_variants(self.methods, self.sources)
        for bag in self.bags:
            reader = RequestReader(bag, self.selection, self.window)
            for request in reader.requests():
                try:
                    sample, is_sample = self.sample(request)
                except GridMapError as error:
                    problem = f'{bag.path}: request {request.index}: {error}'
                    bag.problems.leave_out(problem, f'{bag.path}: requests left out')
                    continue
                self._keep(sample)
                asked = self.settings.request
                if request.tolerance > 0.0:
                    asked = replace(asked, tolerance=request.tolerance)
                if asked.instruction is None:
                    asked = replace(asked, instruction=request.asked(self.places))
                settings = replace(self.settings, request=asked)
                for task in make_tasks([(sample, 1)], variants, self.sources, settings, done):
                    yield replace(task, recorded=request.columns, is_sample=is_sample)

    def sample(self, request: BagRequest) -> tuple[BenchmarkSample, bool]:
        """Return a request as a numbered sample, and whether its dataset has the same sample.

        Raises GridMapError for a bad pose.
        """
        barriers, grid_map = request.barrier_map, request.grid_map
        start, goal = (grid_map.world_to_cell(*pose[:2]) for pose in (request.start, request.goal))
        if barriers is None:
            map_id = self._ids.map_id(grid_map.digest, None)
            pair = self._ids.pair(map_id, None, 0)
            return BenchmarkSample(GridProblem(map_id, grid_map), pair, Sample(start, goal)), False
        map_id = self._ids.map_id(grid_map.digest, barriers.id)
        # A dataset's coordinates begin at its range; its cells at 0.
        x_min, y_min = barriers.offset
        sample = Sample((start[0] + x_min, start[1] + y_min), (goal[0] + x_min, goal[1] + y_min))
        own = next((n for n, s in enumerate(barriers.samples) if s[:2] == sample[:2]), None)
        pair = self._ids.pair(map_id, own, len(barriers.samples))
        if own is not None:
            sample = barriers.samples[own]
        bare = replace(barriers, id=map_id, samples=())
        return BenchmarkSample(bare, pair, sample), pair == own and map_id == barriers.id

    def _keep(self, sample: BenchmarkSample) -> None:
        """Keep a request and its map for the report while there is room."""
        map_id = sample.barrier_map.id
        kept = self._kept.get(map_id, sample.barrier_map)
        cells = sum(map(count_cells, self._kept.values()))
        has_room = len(self._kept) < MAX_MAPS and cells + count_cells(kept) <= MAX_CELLS
        # The requests kept are those with the first numbers, so that each keeps its own.
        if len(kept.samples) == sample.pair < MAX_REQUESTS:
            kept = replace(kept, samples=(*kept.samples, sample.sample))
        if map_id in self._kept or has_room:
            self._kept[map_id] = kept

    def kept_maps(self) -> list[ProblemMap]:
        """Return the maps for the report in order of their ids."""
        return [self._kept[map_id] for map_id in sorted(self._kept)]


def count_cells(problem: ProblemMap) -> int:
    """Return the number of cells of a map."""
    if isinstance(problem, BarrierMap):
        return math.prod(problem.size)
    return problem.grid_map.cells.size
