"""Plug-ins of other packages in the commands and the nodes, as their authors would run them."""

import contextlib
import csv
import os
import shutil
import subprocess
import sys
from pathlib import Path

import pytest
from graph_tools import PATIENCE, process
from llm_astar_planner.cli.doctor import plugin_findings
from llm_astar_planner.cli.param import ACTIONS
from llm_astar_planner.nodes.tools.parameter_client import RemoteParameterError, parameter_client
from llm_astar_planner.search.methods import SEARCH_METHODS
from llm_astar_planner.waypoints.source import SOURCES

ROOT = Path(__file__).resolve().parents[1]
EXAMPLE = ROOT / 'examples' / 'plugin'
GREEDY = 'greedy_best_first', 'llm_astar_example_plugin:greedy_best_first'
SIDESTEP = 'sidestep', 'llm_astar_example_plugin:make_sidestep'
COMMAND = (sys.executable, '-m', 'llm_astar_planner.cli')
# Plug-ins that do everything wrong that they can.
BROKEN = """
import sys
import time

import numpy as np
from llm_astar_planner.search.astar import exact_method
from llm_astar_planner.search.result import SearchResult, SearchStatus
from llm_astar_planner.waypoints.source import WaypointReply


class Source:
    def __init__(self, context):
        pass

    def waypoints(self, query):
        if query.sample.pair == 0:
            sys.exit(3)
        if query.sample.pair == 1:
            return [[1, 2]]
        if query.sample.pair == 2:
            return WaypointReply(((float('nan'), 1),))
        return WaypointReply(((1, 1),) * 1_000_000)


calls = []


def search(problem):
    calls.append(problem)
    if len(calls) % 3 == 1:
        sys.exit(4)
    if len(calls) % 3 == 2:
        return SearchResult(SearchStatus.FOUND, -1, 0, problem.blocked)
    return SearchResult(SearchStatus.FOUND, 1, 0, problem.blocked, np.ones((1_000_000, 2), int))


def hang(problem):
    while problem.start == (39, 18) and time.monotonic() < problem.deadline + 0.5:
        time.sleep(0.1)
    return exact_method(problem)
"""
ABSENT = '[llm_astar.waypoint_sources]\nbroken = no_such_package:make\noracle = sys:exit\n'


@pytest.fixture(scope='module')
def site(tmp_path_factory):
    """A folder with the example as pip installs it, and with plug-ins that are broken."""
    folder = tmp_path_factory.mktemp('site')
    # A copy, since building writes into it.
    copy = shutil.copytree(EXAMPLE, folder / 'source', ignore=shutil.ignore_patterns('build'))
    pip = (sys.executable, '-m', 'pip', '--quiet', '--disable-pip-version-check', 'install')
    options = ('--no-index', '--no-deps', '--no-build-isolation', '--target', folder / 'site')
    subprocess.run([*pip, *options, copy], check=True, timeout=120)
    (folder / 'site' / 'broken_plugins.py').write_text(BROKEN)
    metadata = folder / 'site' / 'absent-1.0.dist-info'
    metadata.mkdir()
    (metadata / 'METADATA').write_text('Metadata-Version: 2.1\nName: absent\nVersion: 1.0\n')
    (metadata / 'entry_points.txt').write_text(ABSENT)
    return folder / 'site'


def run(site, *words):
    paths = [*filter(None, sys.path), str(site)]
    environment = {**os.environ, 'PYTHONPATH': os.pathsep.join(paths)}
    return subprocess.run(
        [*COMMAND, *map(str, words)], capture_output=True, text=True, env=environment, timeout=200
    )


@pytest.fixture(scope='module')
def bench(site, tmp_path_factory):
    """What a run with the example and with broken plug-ins prints, and its rows."""
    out = tmp_path_factory.mktemp('bench') / 'out'
    methods = 'llm_astar', *GREEDY, 'broken_plugins:search', 'broken_plugins:hang'
    sources = 'oracle', *SIDESTEP, 'broken_plugins:Source'
    done = run(
        site, 'bench', '--map', 'demo.json', '--map-ids', 0, '--out', out,
        '--max-planning-time', 1.5,
        '--methods', ','.join(methods), '--source', ','.join(sources),
    )  # fmt: skip
    assert 'Traceback' not in done.stderr, done.stderr
    with (out / 'results.csv').open(newline='') as file:
        return done, list(csv.DictReader(file))


def test_bench_runs_the_example_by_the_names_of_its_entry_points_and_by_its_module(bench):
    _, rows = bench
    figures = {}
    for row in rows:
        if row['method'] in GREEDY and row['source'] in ('none', 'oracle', *SIDESTEP):
            assert row['code'] == 'NONE'
            assert row['ratio'] == '', 'it proves nothing'
            assert row['source_status'] == ('NONE' if row['source'] == 'none' else 'OK')
            assert row['guided_by'] in ('none', row['source'])
            assert float(row['operation']) > 0
            key = row['method'], row['source'], row['pair']
            figures[key] = row['operation'], row['length'], row['waypoints']
    pairs = {row['pair'] for row in rows}
    assert len(figures) == 2 * 4 * len(pairs)
    by_name, by_module = GREEDY
    for (method, source, pair), found in figures.items():
        same = SIDESTEP[0] if source in SIDESTEP else source
        assert found == figures[by_name, same, pair], 'the same by both names'
        assert method in (by_name, by_module)
    lengths = {row['pair']: float(row['length']) for row in rows if row['method'] == 'astar'}
    for (_, _, pair), (_, length, _) in figures.items():
        assert float(length) >= lengths[pair] - 1e-6


def test_a_broken_plug_in_costs_its_samples_only_and_is_named(bench):
    done, rows = bench
    assert done.returncode == 3, 'incomplete'
    of_source = {
        row['pair']: row
        for row in rows
        if (row['method'], row['source']) == ('llm_astar', 'broken_plugins:Source')
    }
    assert [of_source[pair]['source_status'] for pair in '0123'] == [*['ERROR'] * 3, 'OK']
    assert of_source['3']['waypoints'].count(';') == 999
    others = [row for row in rows if 'broken' not in row['method']]
    assert {row['code'] for row in others} == {'NONE'}
    codes = {(row['method'], row['pair']): row['code'] for row in rows}
    for pair in of_source:
        assert codes['broken_plugins:search', pair] == 'UNKNOWN'
        assert codes['broken_plugins:hang', pair] == ('TIMEOUT' if pair == '0' else 'NONE')
    for line in (
        'plug-in broken_plugins:Source: SystemExit: 3 (broken_plugins.py, line 17)',
        'plug-in broken_plugins:Source: returned list, not a WaypointReply',
        'plug-in broken_plugins:Source: waypoints: (nan, 1) is not two finite numbers (x, y)',
        'plug-in broken_plugins:search: SystemExit: 4 (broken_plugins.py, line',
        'plug-in broken_plugins:search: expansions: -1 is not a whole number of 0 or more',
        'plug-in broken_plugins:search: path: has 1000000 cells, more than the map',
        'plug-in broken_plugins:hang: came back 0.',
        'llm_astar/broken_plugins:Source: 3 samples without an answer (ERROR 3)',
    ):
        assert line in done.stderr, done.stderr


def test_plan_names_what_it_cannot_load_in_one_line(site):
    done = run(site, 'plan', '--method', 'broken_plugins:nothing')
    assert done.returncode == 2
    reason = "AttributeError: module 'broken_plugins' has no attribute 'nothing'"
    assert f'search method broken_plugins:nothing cannot be loaded: {reason}' in done.stderr
    assert len(done.stderr.splitlines()) == 1


@pytest.fixture
def installed(site, monkeypatch):
    """This process with the plug-ins of the site, which it forgets again."""
    monkeypatch.syspath_prepend(site)
    with contextlib.ExitStack() as stack:
        for plugins in (SOURCES, SEARCH_METHODS):
            vars(plugins).pop('installed', None)
            stack.callback(vars(plugins).pop, 'installed', None)
            stack.callback(plugins.loaded.pop, 'sidestep', None)
            stack.callback(plugins.loaded.pop, 'greedy_best_first', None)
        yield


def test_the_doctor_lists_plug_ins_and_why_one_cannot_be_imported(installed):
    found = {item.name: item for item in plugin_findings()}
    assert found['sidestep'].found
    assert 'of llm-astar-example-plugin 0.1.0' in found['greedy_best_first'].detail
    assert not found['broken'].found
    assert "No module named 'no_such_package'" in found['broken'].detail
    assert 'llm-astar has one of this name' in found['oracle'].detail
    assert not any(item.required for item in found.values())


def test_nodes_take_code_at_the_start_only(site, monkeypatch):
    monkeypatch.setenv('PYTHONPATH', os.pathsep.join([*filter(None, sys.path), str(site)]))
    space, source, method = '/plugins', SIDESTEP[1], GREEDY[1]
    with (
        process('llm_client_node', '-p', f'source:={source}', namespace=space, files=()),
        process('planner_node', '-p', f'method:={method}', namespace=space, files=()),
        parameter_client(space, [], PATIENCE) as client,
    ):
        for name, values in (
            ('llm_client_node source', ('straight', SIDESTEP[0], source)),
            ('planner_node method', ('astar', GREEDY[0], method)),
        ):
            place = name.split()
            assert ACTIONS['get'](client, *place)[0] == values[-1]
            for value in values:
                assert ACTIONS['set'](client, *place, value)[0] == value
            for value, words in (
                ('broken_plugins:Source', 'names code, which is imported only where'),
                ('no_such_plugin', 'is not one of'),
            ):
                with pytest.raises(RemoteParameterError, match=f'refused it: .*{words}'):
                    ACTIONS['set'](client, *place, value)
