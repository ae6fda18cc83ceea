"""Kernels are compiled in the background: what waits for them can be cancelled, and is told."""

import re
import threading
import time

import numpy as np
import pytest
from llm_astar_planner.costmap.config import CostmapConfig
from llm_astar_planner.planning import compile as kernel_compiler
from llm_astar_planner.planning.compile import (
    KernelCompiler,
    compilations,
    compile_progress,
)
from llm_astar_planner.planning.types import PlanRequest
from numba import njit

REQUEST = PlanRequest((0, 0), (0, 0))


def new_function():
    """Return a function that numba has not compiled."""
    return njit(lambda numbers: numbers.sum() + 1)


def wait_for_all(compiler):
    deadline = time.monotonic() + 60.0
    while compiler.done < 6:
        assert time.monotonic() < deadline
        time.sleep(0.01)


@pytest.fixture
def steps(monkeypatch):
    """The steps of the compiler, which wait until they are let go on."""
    gates = {
        name: threading.Event()
        for name in ('for', 'map_kernels', 'instruction_kernels', 'kernels')
    }
    for name, gate in gates.items():

        def step(*_, gate=gate, **__):
            assert gate.wait(30.0)
            new_function()(np.zeros(3))

        monkeypatch.setattr(kernel_compiler, f'compile_{name}', step)
    # A busy machine may take long for a function.
    monkeypatch.setattr(kernel_compiler, 'REPORT_SECONDS', 600.0)
    yield gates
    for gate in gates.values():
        gate.set()


def test_what_is_needed_first_is_waited_for_alone_and_announced(steps):
    said = []
    compiler = KernelCompiler(CostmapConfig(), REQUEST, said.append)
    assert not compiler.wait(lambda: compiler.done > 1)
    steps['for'].set()
    assert compiler.wait()
    assert compiler.done < 4
    for gate in steps.values():
        gate.set()
    wait_for_all(compiler)
    compiler.close()
    assert len(said) == 3
    assert 'up to a minute' in said[0]
    assert 'plans go on' in said[1]


def test_a_caller_who_gives_up_gets_its_own_exception(steps):
    def give_up():
        raise KeyError

    compiler = KernelCompiler(CostmapConfig(), REQUEST, str)
    with pytest.raises(KeyError):
        compiler.wait(give_up)
    steps['for'].set()
    compiler.close()


def test_a_closed_compiler_stops_before_the_next_function_and_releases_those_who_wait(steps):
    compiler = KernelCompiler(CostmapConfig(), REQUEST, str)
    waiting = threading.Thread(target=compiler.wait)
    waiting.start()
    closing = threading.Thread(target=compiler.close)
    closing.start()
    waiting.join(30.0)
    assert not waiting.is_alive()
    steps['for'].set()
    closing.join(30.0)
    assert not closing.is_alive()
    assert not compiler.is_ready


def test_what_the_cache_has_is_loaded_for_a_first_plan_alone(steps, monkeypatch):
    for name in ('for', 'map_kernels'):
        monkeypatch.setattr(kernel_compiler, f'compile_{name}', lambda *_, **__: None)
    compiler = KernelCompiler(CostmapConfig(), REQUEST, str)
    compiler._thread.join(30.0)
    assert compiler.is_ready
    assert compiler.done == 5
    compiler.close()


def test_plans_go_on_where_the_searches_do_not_compile(steps, monkeypatch):
    def fail(*_, **__):
        raise OSError('no space left on device')

    monkeypatch.setattr(kernel_compiler, 'compile_for', fail)
    said = []
    compiler = KernelCompiler(CostmapConfig(), REQUEST, said.append)
    assert compiler.wait()
    compiler.close()
    assert said[0] == 'the searches do not compile: OSError: no space left on device'


def test_how_far_it_is_is_reported_until_plans_can_go_on(steps, monkeypatch):
    monkeypatch.setattr(kernel_compiler, 'REPORT_SECONDS', 0.0)

    def compile_two(*_, **__):
        for function in (new_function(), new_function()):
            function(np.zeros(3))

    monkeypatch.setattr(kernel_compiler, 'compile_for', compile_two)
    for gate in steps.values():
        gate.set()
    said = []
    compiler = KernelCompiler(CostmapConfig(), REQUEST, said.append)
    wait_for_all(compiler)
    compiler.close()
    assert re.fullmatch(r'compiling the searches: \d+ s of up to a minute \(<lambda>\)', said[1])
    assert len(said) == 4


def test_whoever_compiles_can_report_it_and_who_loads_says_nothing(monkeypatch):
    monkeypatch.setattr(kernel_compiler, 'REPORT_SECONDS', 0.0)
    functions = [new_function(), new_function()]
    said = []
    for _ in range(2):
        with compile_progress(said.append, 'the first waypoints', 'go on'):
            for one in functions:
                one(np.zeros(3))
    assert 'the first waypoints wait for up to a minute' in said[0]
    assert re.fullmatch(r'compiling the searches: \d+ s of up to a minute \(<lambda>\)', said[1])
    assert re.fullmatch(r'searches compiled in \d+\.\d s: go on', said[2])
    assert len(said) == 3


def test_the_functions_that_are_compiled_are_named_and_cached_ones_are_not():
    compiled = []
    one, other = new_function(), new_function()
    with compilations(compiled.append):
        one(np.zeros(3))
        other(np.zeros(3))
        one(np.zeros(3))
    assert compiled == ['<lambda>', '<lambda>']
