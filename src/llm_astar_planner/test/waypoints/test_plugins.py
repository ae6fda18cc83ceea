"""Sources of other packages: found by name, their replies checked."""

import os
import pickle
import re
import sys
import threading
import time

import numpy as np
import pytest
from llm_astar_msgs_adapter.maps.grid_map import GridMap
from llm_astar_planner.costmap.costmap import Costmap
from llm_astar_planner.plugins import PluginError, Plugins
from llm_astar_planner.waypoints.async_query import query_source
from llm_astar_planner.waypoints.config import (
    SOURCE_NAMES,
    SettingsError,
    SourceContext,
    SourceSettings,
    make_source,
)
from llm_astar_planner.waypoints.source import (
    SOURCES,
    PluginSource,
    SourceStatus,
    WaypointQuery,
    WaypointReply,
    plugin_factory,
)

QUERY = WaypointQuery(Costmap(GridMap(np.zeros((9, 9), np.int8))), (1, 1), (7, 7), 5.0)
MODULE = """
from llm_astar_planner.waypoints.source import WaypointReply

class Middle:
    name = 'its own name'

    def __init__(self, context):
        self.seed = context.seed

    def waypoints(self, query):
        return WaypointReply(((4, 4 + self.seed),), label='anything')

def exits(context):
    raise SystemExit(7)

def nothing(context):
    return None

raised = 1 / 1
"""


@pytest.fixture
def module(tmp_path, monkeypatch):
    """A module in the working directory, of a name of its own; yields the name."""
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(sys, 'path', [*sys.path])
    name = f'plugin_{os.getpid()}_{time.monotonic_ns()}'
    (tmp_path / f'{name}.py').write_text(MODULE)
    yield name
    for loaded in [key for key in SOURCES.loaded if key.startswith(name)]:
        del SOURCES.loaded[loaded]


class Source:
    """A source that does what it is told to."""

    name = 'foreign'

    def __init__(self, answer):
        self.answer = answer

    def waypoints(self, query):
        return self.answer(query)


def ask(answer, query=QUERY, name=None):
    source = PluginSource(name or f'plug-in {time.monotonic_ns()}', Source(answer))
    return query_source(source, query)[0]


def raises(error):
    def answer(query):
        raise error

    return answer


class UnreadableError(Exception):
    def __str__(self):
        raise RuntimeError


def test_a_source_is_made_by_module_and_factory_and_named_after_it(module):
    name = f'{module}:Middle'
    SOURCES.admit(name)
    source = make_source(SourceSettings(source=name), seed=1)
    assert source.name == name
    reply, _ = query_source(source, QUERY)
    assert (reply.waypoints, reply.label, reply.status) == (((4.0, 5.0),), name, SourceStatus.OK)
    assert pickle.loads(pickle.dumps(source)).waypoints(QUERY) == reply  # noqa: S301


def test_code_is_imported_only_where_the_start_names_it(module):
    name = f'{module}:Middle'
    with pytest.raises(SettingsError, match='names code, which is imported only'):
        make_source(SourceSettings(source=name))
    assert module not in sys.modules


def test_what_cannot_be_loaded_is_named_with_the_reason(module, tmp_path):
    (tmp_path / f'{module}_exits.py').write_text('import sys\n\nsys.exit("no licence")\n')
    for name, words in (
        (f'{module}:absent', 'has no attribute'),
        ('no_such_module:factory', "No module named 'no_such_module'$"),
        (f'{module}_exits:factory', rf'SystemExit: no licence \({module}_exits.py, line 3\)'),
        ('a b:c', 'invalid format'),
        (f'{module}:{"x" * 300}', 'is not the name of a source'),
    ):
        with pytest.raises(PluginError, match=words) as caught:
            SOURCES.admit(name)
        assert name[:20] in str(caught.value)
        assert name not in SOURCES.loaded


def test_a_factory_that_makes_no_source_is_named(module):
    for factory, words in (('exits', 'SystemExit: 7'), ('nothing', r'NoneType.* no waypoints\(')):
        SOURCES.admit(f'{module}:{factory}')
        with pytest.raises(PluginError, match=f'source {module}:{factory}: .*{words}'):
            make_source(SourceSettings(source=f'{module}:{factory}'))


@pytest.mark.parametrize(
    ('answer', 'detail'),
    [
        (raises(ValueError('no idea')), r'ValueError: no idea \(test_plugins.py, line \d+\)'),
        (raises(SystemExit(3)), 'SystemExit: 3'),
        (raises(KeyboardInterrupt()), 'KeyboardInterrupt'),
        (raises(UnreadableError()), 'UnreadableError without a readable message'),
        (lambda query: [[1, 2]], 'returned list, not a WaypointReply'),
        (lambda query: None, 'returned NoneType, not a WaypointReply'),
        (lambda query: WaypointReply(((float('nan'), 1),)), r'waypoints: \(nan, 1\) is not two'),
        (lambda query: WaypointReply((('1', None),)), 'is not two finite numbers'),
        (lambda query: WaypointReply(((1, 2, 3),)), 'is not two finite numbers'),
        (lambda query: WaypointReply(('12', {1: 2, 3: 4})), "waypoints: '12' is not two finite"),
        (lambda query: WaypointReply(7), 'TypeError'),
        (lambda query: WaypointReply(status='FINE'), "'FINE' is not a valid SourceStatus"),
        (lambda query: WaypointReply(prompt_tokens=-1), 'prompt_tokens: -1 is not a whole'),
        (lambda query: WaypointReply(seconds=float('nan')), 'seconds: nan is not a time'),
        (lambda query: WaypointReply(model='m' * 999), 'model or prompt: .* is no name'),
    ],
)
def test_a_plug_in_that_fails_gives_an_error_that_says_why(answer, detail):
    reply = ask(answer)
    assert (reply.status, reply.waypoints) == (SourceStatus.ERROR, ())
    assert len(reply.detail.splitlines()) == 1
    assert re.search(detail, reply.detail), reply.detail


def test_a_plug_in_may_say_how_long_its_model_took():
    assert ask(lambda query: WaypointReply(seconds=3)).seconds == 3.0


def test_of_a_million_waypoints_a_thousand_are_read():
    endless = ((x, 1.0) for x in iter(int, 1))
    for points in (((1, 1),) * 1_000_000, endless):
        reply = ask(lambda query, points=points: WaypointReply(points))
        assert len(reply.waypoints) == 1000
        assert reply.detail == 'only its first 1000 waypoints'


def test_a_plug_in_that_hangs_is_left_behind():
    released = threading.Event()
    short = WaypointQuery(QUERY.costmap, (1, 1), (7, 7), 0.05)

    def hang(query):
        released.wait(60.0)
        return WaypointReply(((1, 1),))

    begin = time.monotonic()
    reply = ask(hang, short, 'hanging plug-in')
    released.set()
    assert time.monotonic() - begin < 30.0
    assert reply.status is SourceStatus.TIMEOUT
    assert 'hanging plug-in had not answered after 0.' in reply.detail
    assert ask(hang, QUERY, 'hanging plug-in').waypoints == ((1.0, 1.0),)


def test_a_plug_in_sees_when_nobody_waits_any_more():
    seen = []

    def answer(query):
        while not query.stop[0]:
            time.sleep(0.005)
        seen.append(True)
        return WaypointReply()

    ask(answer, WaypointQuery(QUERY.costmap, (1, 1), (7, 7), 0.05))
    deadline = time.monotonic() + 60.0
    while not seen and time.monotonic() < deadline:
        time.sleep(0.01)
    assert seen


def test_every_source_of_the_package_comes_from_the_same_table():
    assert tuple(SOURCES.own) == SOURCE_NAMES
    assert 'straight' in SOURCE_NAMES
    settings = SourceSettings(source='straight')
    assert make_source(settings) == SOURCES.load('straight')(SourceContext(settings))
    broken = Plugins('source', 'no.such.group', {'mine': 'no_such:thing'}, plugin_factory)
    assert broken.problem('mine') is None, 'nothing is imported to check a name'
    with pytest.raises(ModuleNotFoundError):
        broken.load('mine')
    assert broken.problem('other') == "'other' is not one of mine"
    assert broken.problem(3) == '3 is not a name'
