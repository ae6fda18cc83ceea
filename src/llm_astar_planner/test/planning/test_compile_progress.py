"""A compilation is never silent."""

import re

import numpy as np
from llm_astar_planner.planning import compile as kernel_compiler
from numba import njit


def compile_one():
    njit(lambda numbers: numbers.sum() + 1)(np.zeros(3))


def test_a_line_says_that_it_begins_and_one_that_it_ended(monkeypatch):
    # A busy machine may take long for a function.
    monkeypatch.setattr(kernel_compiler, 'REPORT_SECONDS', 600.0)
    said = []
    with kernel_compiler.compile_progress(said.append):
        compile_one()
        compile_one()
    began, ended = said
    assert began == 'compiling the searches, once after an installation, up to a minute'
    assert re.fullmatch(r'searches compiled in \d+\.\d s', ended)


def test_nothing_is_said_where_nothing_is_compiled():
    said = []
    with kernel_compiler.compile_progress(said.append):
        pass
    assert said == []
