"""What a plan takes is compiled before its time begins, and nothing of it afterwards."""

import os
import subprocess
import sys

import numpy as np
import pytest
from llm_astar_msgs_adapter.maps.grid_map import GridMap
from llm_astar_planner.planning import compile as module
from llm_astar_planner.planning.compile import CompilationStopped
from llm_astar_planner.planning.path_planner import COMPILED
from llm_astar_planner.planning.planner import NOT_COMPILED, Planner
from llm_astar_planner.planning.types import PlanRequest, ResultCode

# Counts what numba compiles while plans run, but not while they wait for the compilation.
SCRIPT = """
import sys
import numpy as np
from llm_astar_msgs_adapter.maps.grid_map import GridMap, Pose2D
from llm_astar_planner import Planner, PlanRequest
from llm_astar_planner.instructions.interpretation import Interpretation, RouteInstruction
from llm_astar_planner.instructions.clauses.avoid import Avoid
from llm_astar_planner.instructions.clauses.before import Before
from llm_astar_planner.instructions.clauses.clause import SHOULD
from llm_astar_planner.instructions.clauses.end_at import EndAt
from llm_astar_planner.instructions.clauses.keep_distance import KeepDistance
from llm_astar_planner.instructions.clauses.pass_by import Pass
from llm_astar_planner.instructions.clauses.stay_in import StayIn
from llm_astar_planner.instructions.clauses.visit import Visit
from llm_astar_planner.instructions.regions import Box, Disc
from llm_astar_planner.instructions.specification import Specification
from llm_astar_planner.planning.compile import compilations
from llm_astar_planner.planning.footprint import Footprint

cells = np.zeros((300, 400), dtype=np.int8)
cells[40:, 100] = cells[:250, 200] = cells[40:, 300] = 100
START, GOAL = (3, 290), (396, 290)
NEAR, FAR, MIDDLE = Disc(12.0, 10.0, 2.0), Disc(380.0, 10.0, 2.0), Disc(250.0, 30.0, 2.0)
INSTRUCTIONS = [
    (Visit(regions=(NEAR, FAR, MIDDLE)),),
    (Before(first=FAR, second=NEAR), EndAt(region=MIDDLE)),
    (Avoid(strength=SHOULD, region=Box(90.0, 0.0, 110.0, 60.0)), KeepDistance(metres=3.0)),
    (Pass(region=Disc(150.0, 150.0, 5.0), side='north'), StayIn(region=Box(0, 0, 400, 299))),
]
REQUESTS = {
    'direct': [PlanRequest(START, GOAL)],
    'instruction': [
        PlanRequest(
            START, GOAL, instruction=RouteInstruction(Interpretation('', Specification(clauses)))
        )
        for clauses in INSTRUCTIONS
    ],
}
functions = []
planner = Planner(GridMap(cells))
if 'prepare' in sys.argv:
    planner.prepare()
for request in REQUESTS[sys.argv[1]]:
    assert planner.compile(request)
    with compilations(functions.append):
        plan = planner.plan(request)
    assert not plan.code, plan.message
    assert 'direct path' not in plan.message
    assert plan.instruction is None or all(
        clause.status.value == 'kept' for clause in plan.instruction.clauses
    ), plan.message
print(*functions)
"""


@pytest.mark.timeout(900)
@pytest.mark.parametrize(
    'words',
    [('direct',), pytest.param(('instruction', 'prepare'), marks=pytest.mark.slow)],
)
def test_with_an_empty_cache_a_plan_keeps_its_time_limit_and_compiles_nothing(words, tmp_path):
    environment = {
        **os.environ, 'PYTHONPATH': os.pathsep.join(sys.path), 'NUMBA_CACHE_DIR': str(tmp_path)
    }  # fmt: skip
    done = subprocess.run(
        [sys.executable, '-c', SCRIPT, *words],
        capture_output=True, text=True, env=environment, timeout=800,
    )  # fmt: skip
    assert done.stderr == ''
    assert done.stdout == '\n'


@pytest.fixture
def fresh():
    """No kind of plan is compiled yet."""
    before = set(COMPILED)
    COMPILED.clear()
    yield Planner(GridMap(np.zeros((20, 20), dtype=np.int8)))
    COMPILED.update(before)


def test_a_plan_that_is_cancelled_while_it_waits_for_the_compilation_says_so(fresh, monkeypatch):
    stop = np.zeros(1, dtype=np.uint8)

    def cancelled(*_, **__):
        stop[0] = 1
        raise CompilationStopped

    monkeypatch.setattr(module, 'compile_plans', cancelled)
    plan = fresh.plan(PlanRequest((1, 1), (9, 9)), stop)
    assert (plan.code, plan.message) == (ResultCode.TIMEOUT, NOT_COMPILED)
    assert not COMPILED


def test_a_plan_goes_on_where_the_searches_do_not_compile(fresh, monkeypatch):
    calls = []

    def fails(*_, **__):
        calls.append(True)
        raise OSError('no space left on device')

    monkeypatch.setattr(module, 'compile_plans', fails)
    for _ in range(2):
        assert fresh.plan(PlanRequest((1, 1), (9, 9))).code is ResultCode.NONE
    assert len(calls) == 1, 'once in a process'


def test_each_kind_of_plan_is_compiled_once(fresh, monkeypatch):
    seen = []
    monkeypatch.setattr(module, 'compile_plans', lambda *given, **_: seen.append(given[1].method))
    for method in ('guided', 'guided', 'astar', 'guided', 'astar'):
        assert fresh.compile(PlanRequest((1, 1), (9, 9), method))
    assert fresh.compile(PlanRequest((1, 1), (9, 9), any_angle=True))
    assert seen == ['guided', 'astar', 'guided']
