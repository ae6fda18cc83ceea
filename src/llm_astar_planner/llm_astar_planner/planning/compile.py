# Copyright 2026 The LLM-A* for ROS 2 contributors
# SPDX-License-Identifier: Apache-2.0

"""Compiles the kernels ahead of plans, or loads them from numba's cache: on small maps of its own.

A `Planner` compiles what a request takes before the time of the request begins. Nodes do so for
all requests in the background, and commands say meanwhile how far it is.
"""

import sys
import threading
import time
from collections.abc import Callable, Iterable, Iterator, Sequence
from contextlib import contextmanager, suppress
from dataclasses import replace
from functools import partial
from itertools import chain, product
from pathlib import Path

import numpy as np
from llm_astar_msgs_adapter.files import read_yaml
from llm_astar_msgs_adapter.maps.grid_map import FREE, OCCUPIED, GridMap, Pose2D
from numba.core import config as numba_config
from numba.core import event

from llm_astar_planner.costmap.config import CostmapConfig
from llm_astar_planner.costmap.costmap import Costmap
from llm_astar_planner.lazy import shapely
from llm_astar_planner.parameter import ParameterError
from llm_astar_planner.planning._kernels.path_checks import nearest_places, passed_cells
from llm_astar_planner.planning.footprint import Footprint
from llm_astar_planner.planning.path_planner import COMPILED, PathPlanner, kind_of_plan
from llm_astar_planner.planning.path_validator import CollisionChecker, invalid_poses
from llm_astar_planner.planning.types import PlanRequest
from llm_astar_planner.search.arrays import StopFlag, no_stop
from llm_astar_planner.search.grid_graph import GridGraph
from llm_astar_planner.search.landmarks import LandmarkManager, Landmarks
from llm_astar_planner.search.methods import EXACT, GUIDED, METHODS
from llm_astar_planner.waypoints.replay import FixedReply

# Seconds, more than compiling takes.
PATIENCE = 3600.0
ANNOUNCEMENT = 'compiling the searches, once after an installation'
# How long that takes where numba has nothing in its cache; else it is a part of a second.
EXPECTED = 'up to a minute'
# Seconds between two sentences on how far it is.
REPORT_SECONDS = 4.0
# Seconds between two looks at whether a plan may still wait.
POLL_SECONDS = 0.02
# Seconds to wait in `close` until the kernel that is being compiled is ready.
LONGEST_KERNEL = 3.0
# Without and with what lethal cells do to others, which takes other kernels.
CONFIGS = (CostmapConfig(), CostmapConfig(robot_radius=1.0, inflation_radius=2.0))
WAYPOINTS = FixedReply('[[2, 2]]')
FOOTPRINT = Footprint(((1.5, 0.3), (1.5, -0.3), (-1.5, -0.3), (-1.5, 0.3)))
START, GOAL, VIA = (2, 20), (21, 20), ((12, 1),)


class CompilationStopped(BaseException):
    """Nobody waits for the compilation any more; nothing in numba may catch it."""


class CompileListener(event.Listener):
    """Notices when a function is compiled on the thread that makes it: it was not in the cache."""

    def __init__(self, on_compile: Callable[[str], None]) -> None:
        """Take what to call each time with the name; what it raises ends the compilation."""
        self._on_compile = on_compile
        self._thread = threading.current_thread()

    def on_start(self, began: event.Event) -> None:
        """Call back."""
        if threading.current_thread() is self._thread:
            self._on_compile(began.data['dispatcher'].py_func.__name__)

    def on_end(self, _: event.Event) -> None:
        """Ignore the end."""


@contextmanager
def compilations(on_compile: Callable[[str], None]) -> Iterator[None]:
    """Call `on_compile` with the name of each function that this thread compiles meanwhile."""
    with event.install_listener('numba:compile', CompileListener(on_compile)):
        yield


def compile_for(
    config: CostmapConfig,
    request: PlanRequest,
    is_graded: bool,
    has_landmarks: bool = False,
    stop: StopFlag | None = None,
) -> bool:
    """Compile what requests like this take on costmaps of `config`; tell whether that is done.

    `is_graded`: where costs are not uniform. `has_landmarks`: where there are landmarks.

    Once for each kind in a process. It ends before the next function when `stop[0]` is 1. That of
    a plug-in's method is compiled without it, since it may take any time. Raises what numba does.
    """
    method = request.method if request.method in METHODS else EXACT
    kind = kind_of_plan(config, request, is_graded, has_landmarks)
    if kind in COMPILED or numba_config.DISABLE_JIT:
        return True

    def check(_: str) -> None:
        if stop is not None and stop[0]:
            raise CompilationStopped

    try:
        with compilations(check):
            compile_plans(config, replace(request, method=method), is_graded, has_landmarks)
            if request.footprint is not None:
                compile_footprint_kernels()
            if request.instruction is not None:
                compile_instruction_kernels(any_angle=request.any_angle)
    except CompilationStopped:
        if stop is None or not stop[0]:
            raise
        return False
    except Exception:
        COMPILED.add(kind)
        raise
    COMPILED.add(kind)
    return True


def compile_plans(
    config: CostmapConfig, like: PlanRequest, is_graded: bool, has_landmarks: bool
) -> None:
    """Plan requests like one on small maps of graded costs, or of uniform ones.

    Where costs are uniform, goals far away take kernels of their own.
    """
    has_source = like.source is not None or like.viapoints
    has_landmarks &= like.method == GUIDED
    for width, occupancy in ((24, 50),) if is_graded else ((100, FREE), (24, FREE)):
        cells = np.zeros((24, width), dtype=np.int8)
        cells[4:, 12], cells[4, 4] = OCCUPIED, occupancy
        planner = PathPlanner(GridMap(cells), config)
        if has_landmarks:
            planner.prepare()
        request = replace(
            like, start=START, goal=(width - 3, 20), via=VIA if like.via else (), viapoints=(),
            source=WAYPOINTS if has_source else None, sample=None, instruction=None,
            footprint=None, time_limit=PATIENCE,
        )  # fmt: skip
        plan = planner.direct_plan(request, no_stop())
        passed_cells(*np.zeros((2, 2), dtype=np.int64))
        if has_source:
            nearest_places(plan.path, np.zeros((1, 2)))


def compile_kernels() -> None:
    """Compile what plans without an instruction run, or load it from numba's cache."""
    compile_map_kernels(landmarks=LandmarkManager())
    compile_zone_kernels()
    compile_why_kernels()
    for config in CONFIGS:
        for method in METHODS:
            request = PlanRequest(START, GOAL, method, source=WAYPOINTS, any_angle=True)
            for is_graded, has_landmarks in product((False, True), repeat=2):
                compile_for(config, request, is_graded, has_landmarks)
            for is_graded in (False, True):
                compile_for(config, replace(request, via=VIA), is_graded)
    compile_footprint_kernels()
    # Large maps of graded costs.
    cost = np.full((24, 200), 50, dtype=np.int8)
    grid = GridGraph(np.zeros((24, 200), dtype=np.bool_), cost=cost)
    Landmarks.build(grid, max_bytes=0)


def compile_map_kernels(
    configs: Sequence[CostmapConfig] = CONFIGS, landmarks: LandmarkManager | None = None
) -> None:
    """Compile what costmaps take, from nothing and in increments, or load it from the cache.

    With `landmarks`, what these take too.
    """
    cells = np.zeros((24, 24), dtype=np.int8)
    for config in configs:
        costmap: Costmap | None = None
        for occupancy in (FREE, 50, OCCUPIED, FREE):
            cells[10:, 12] = occupancy
            costmap = Costmap(GridMap(cells), config, previous=costmap)
            costmap.prepare()
            costmap.line_of_sight.clear([(0, 0)], [(1, 1)])
            if landmarks is not None:
                landmarks.update(costmap.grid_graph)
                landmarks.wait()
        invalid_poses(np.zeros((2, 2), np.int64), CollisionChecker(GridMap(cells), config))


def compile_footprint_kernels() -> None:
    """Compile what plans with a footprint run besides, or load it from numba's cache."""
    # Here and below: other plans do not need it.
    from llm_astar_planner.planning.footprint_search import FootprintChecker  # noqa: PLC0415

    cells = np.zeros((24, 24), dtype=np.int8)
    cells[4:, 12] = OCCUPIED
    planner = PathPlanner(GridMap(cells)).prepare()
    request = PlanRequest(START, GOAL, time_limit=PATIENCE, footprint=FOOTPRINT)
    for pose in (None, Pose2D(3.0, 20.0, 1.0), Pose2D(11.0, 20.0)):
        planner.direct_plan(replace(request, start_pose=pose), no_stop())
    FootprintChecker(planner.costmap, FOOTPRINT).collisions([(3.0, 3.0, 0.0)])


def compile_why_kernels() -> None:
    """Compile what says why there is no path, or load it from numba's cache."""
    from llm_astar_planner.planning.why import Explainer  # noqa: PLC0415

    cells = np.zeros((24, 24), dtype=np.int8)
    cells[:, 12], cells[11:14, 12] = OCCUPIED, FREE
    for radius in (0.0, 3.0):
        costmap = Costmap(GridMap(cells), CostmapConfig(robot_radius=radius))
        Explainer(costmap, PlanRequest(START, (12, 2))).explain()
        Explainer(costmap, PlanRequest(START, GOAL)).explain()


def compile_zone_kernels() -> None:
    """Compile what zones and filter masks take, or load it from the cache."""
    from llm_astar_planner.costmap import zone_layer, zones  # noqa: PLC0415

    grid_map = GridMap(np.zeros((4, 4), dtype=np.int8))
    info = zone_layer.FilterInfo(zone_layer.FilterKind.KEEPOUT, 'mask')
    mask, box = zone_layer.FilterMask(info, grid_map), shapely.box(1.0, 1.0, 2.0, 2.0)
    rule = zones.Zone('rule', box, 0, kind=zones.ONE_WAY, heading=0.0)
    layer = zone_layer.ZoneLayer(grid_map, (zones.Zone('zone', box), rule), [mask])
    Costmap(layer.compose(grid_map)).reached((0, 0))


def compile_instruction_kernels(*, any_angle: bool = True) -> None:
    """Compile the kernels for instructions, or load them; without `any_angle` fewer."""
    # Many modules, which other plans do not need.
    from llm_astar_planner.instructions import interpretation  # noqa: PLC0415
    from llm_astar_planner.instructions.specification import from_json  # noqa: PLC0415
    from llm_astar_planner.planning.instruction import plan_with_instruction  # noqa: PLC0415

    for sample in read_yaml(Path(__file__).with_name('compiled.yaml'), ParameterError):
        cells = np.zeros((sample['side'], sample['side']), dtype=np.int8)
        cells[4:, 12] = OCCUPIED
        planner = PathPlanner(GridMap(cells)).prepare()
        understood = interpretation.Interpretation('', from_json({'clauses': sample['clauses']}))
        instruction = interpretation.RouteInstruction(understood)
        request = PlanRequest(
            START, GOAL, time_limit=PATIENCE, any_angle=any_angle, instruction=instruction
        )
        plan_with_instruction(planner, request, instruction, no_stop())


class CompileReport:
    """Says when kernels begin to be compiled, how far that is, and when it ends.

    Nothing where they are only loaded.
    """

    def __init__(self, say: Callable[[str], None], who_waits: str = '') -> None:
        """Take what gets the sentences, and in a node who waits until it ends."""
        self.is_compiling = False
        self._say, self._who_waits = say, who_waits
        self._began = self._reported = 0.0

    def note(self, function: str, *, is_waited_for: bool = True) -> None:
        """Report that and how far it compiles, the latter only while somebody waits for it."""
        now = time.monotonic()
        is_first, self.is_compiling = not self.is_compiling, True
        if is_first:
            self._began = self._reported = now
            self._say(self.announcement())
        elif is_waited_for and now - self._reported >= REPORT_SECONDS:
            self._reported = now
            seconds = f'{now - self._began:.0f} s of {EXPECTED}'
            self._say(f'compiling the searches: {seconds} ({function})')

    def announcement(self) -> str:
        """Say that it begins, how long it takes, and in a node who waits and where it is kept."""
        if not self._who_waits:
            return f'{ANNOUNCEMENT}, {EXPECTED}'
        folder = numba_config.CACHE_DIR
        where = f'; they are kept in {folder}' if folder else ''
        return f'{ANNOUNCEMENT}: {self._who_waits} wait for {EXPECTED}{where}'

    def finish(self, what: str = '') -> None:
        """Report the end, and `what` goes on now, if anything had to be compiled."""
        if self.is_compiling:
            then = f': {what}' if what else ''
            self._say(f'searches compiled in {time.monotonic() - self._began:.1f} s{then}')


@contextmanager
def compile_progress(
    say: Callable[[str], None] | None = None, who_waits: str = '', what: str = ''
) -> Iterator[None]:
    """Report what this thread compiles: that it begins, how far it is, and the end.

    `say` gets the sentences, standard error without it. In a node `who_waits` names what waits for
    the end, and `what` says what goes on then.
    """
    report = CompileReport(say or partial(print, file=sys.stderr, flush=True), who_waits)
    with compilations(report.note):
        yield
    report.finish(what)


class KernelCompiler:
    """Compiles the kernels on a thread of its own, or loads them from numba's cache.

    Where nothing has to be compiled that takes half a second. `say` gets a sentence when it begins
    to compile, every few seconds until plans can go on, and when they can.
    """

    def __init__(
        self, config: CostmapConfig, request: PlanRequest, say: Callable[[str], None]
    ) -> None:
        """Start; first comes what requests like this take on costmaps of `config`."""
        # How many of its steps are done, and whether the first is, after which plans go on.
        self.done, self.is_ready = 0, False
        self._say = say
        self._report = CompileReport(say, 'the first plans')
        self._is_closed = False
        guided = replace(request, source=WAYPOINTS)
        steps = (
            # Plans go on after this; on maps of uniform costs they take the next one too.
            lambda: compile_for(config, request, is_graded=True),
            lambda: compile_for(config, request, is_graded=False),
            lambda: [compile_for(config, guided, graded, True) for graded in (True, False)],
            lambda: compile_map_kernels([config]),
            compile_why_kernels,
        )
        self._thread = threading.Thread(
            target=self.work, args=(steps,), name='compiler', daemon=True
        )
        self._thread.start()

    def wait(self, may_wait: Callable[[], bool] = lambda: True) -> bool:
        """Wait until a first plan can be made, while `may_wait()`; tell whether it can.

        Raises what `may_wait` raises.
        """
        while not (self.is_ready or self._is_closed) and may_wait():
            time.sleep(POLL_SECONDS)
        return self.is_ready

    def close(self) -> None:
        """Stop compiling; what is compiled stays."""
        self._is_closed = True
        self._thread.join(LONGEST_KERNEL)

    def work(self, steps: Iterable[Callable[[], object]]) -> None:
        """Run all steps until closed.

        Where one fails, plans go on: each compiles on its own then, and says what is wrong.
        """
        with compilations(self.on_compile), suppress(CompilationStopped):
            for step in chain(steps, self.last_steps()):
                try:
                    step()
                except Exception as error:  # noqa: BLE001 - whatever numba raises
                    problem = f'{type(error).__name__}: {error}'
                    self._say(f'the searches do not compile: {problem}')
                self.done += 1
                if not self.is_ready:
                    self.is_ready = True
                    self._report.finish('plans go on')
            self._report.finish('all of them')

    def last_steps(self) -> Iterator[Callable[[], object]]:
        """Yield what compiles the rest, where the cache had not even the first.

        Else that is loaded when a request takes it, in a third of a second: it takes 32 MB.
        """
        if self._report.is_compiling:
            yield compile_instruction_kernels
            yield compile_kernels

    def on_compile(self, function: str) -> None:
        """Report that and how far it compiles. Raises CompilationStopped when closed."""
        if self._is_closed:
            raise CompilationStopped
        self._report.note(function, is_waited_for=not self.is_ready)
