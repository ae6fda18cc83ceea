"""A compilation is never silent."""

import io
import re

import numpy as np
from llm_astar_planner.planning.compile import compile_progress
from numba import njit


def compile_one():
    njit(lambda numbers: numbers.sum() + 1)(np.zeros(3))


def test_a_line_says_that_it_begins_and_one_that_it_ended():
    stream = io.StringIO()
    with compile_progress(stream):
        compile_one()
        compile_one()
    began, ended = stream.getvalue().splitlines()
    assert began == 'compiling the searches, once after an installation, about 15 s'
    assert re.fullmatch(r'searches compiled in \d+\.\d s', ended)


def test_nothing_is_said_where_nothing_is_compiled():
    stream = io.StringIO()
    with compile_progress(stream):
        pass
    assert stream.getvalue() == ''
