"""A compilation is never silent: a live line on a terminal, plain lines elsewhere."""

import io
import re

import numpy as np
import pytest
from llm_astar_planner.planning.compile import compile_progress
from numba import njit


class Terminal(io.StringIO):
    """Takes what is written for a terminal."""

    def isatty(self):
        return True


def compile_one():
    njit(lambda numbers: numbers.sum() + 1)(np.zeros(3))


def test_where_there_is_no_terminal_a_line_says_that_it_begins_and_one_that_it_ended():
    stream = io.StringIO()
    with compile_progress(stream):
        compile_one()
        compile_one()
    began, ended = stream.getvalue().splitlines()
    assert began == 'compiling the searches, once after an installation, about 15 s'
    assert re.fullmatch(r'searches compiled in \d+\.\d s', ended)


def test_a_terminal_shows_how_far_it_is_in_one_line(monkeypatch):
    monkeypatch.setenv('TERM', 'xterm')
    stream = Terminal()
    with compile_progress(stream):
        compile_one()
    said = stream.getvalue()
    assert said.count('\n') == 1
    assert re.search(r'\r\x1b\[Kcompiling the searches: \d+ s of about 15 s \(<lambda>\)', said)
    assert re.search(r'\r\x1b\[Ksearches compiled in \d+\.\d s\n$', said)


@pytest.mark.parametrize('stream', [io.StringIO(), Terminal()])
def test_nothing_is_said_where_nothing_is_compiled(stream):
    with compile_progress(stream):
        pass
    assert stream.getvalue() == ''


def test_a_terminal_that_cannot_rewrite_a_line_gets_plain_ones(monkeypatch):
    monkeypatch.setenv('TERM', 'dumb')
    stream = Terminal()
    with compile_progress(stream):
        compile_one()
    assert '\x1b' not in stream.getvalue()
