"""Files written by version 0.1.0 are read as they were then; each kind has its own section."""

import csv
import json
import shutil
from collections import Counter
from pathlib import Path

import numpy as np
import pytest
from graph_tools import ALONE, process, wait_for
from llm_astar_lab.bags.reading import Bag
from llm_astar_lab.bags.writing import ros_distro
from llm_astar_lab.commands.dataset import write_sample_bag
from llm_astar_lab.datasets.named import load_samples
from llm_astar_lab.results.folder import ResultsFolder
from llm_astar_lab.results.row import ADDED_COLUMNS
from llm_astar_msgs_adapter.maps.barrier_map import load_barrier_maps
from llm_astar_msgs_adapter.maps.grid_map import GridMap
from llm_astar_msgs_adapter.messages.report import ExchangeReport, PlanReport, report_from_message
from llm_astar_planner.cli.main import main
from llm_astar_planner.costmap.costmap import Costmap
from llm_astar_planner.parameter import ParameterError
from llm_astar_planner.planning.parameters import NODES, defaults, read_parameter_files
from llm_astar_planner.resources import find_file
from llm_astar_planner.waypoints.config import SourceSettings, make_source
from llm_astar_planner.waypoints.source import WaypointQuery
from llm_astar_planner.waypoints.transcript import TranscriptWriter, read_transcript

import llm_astar_planner

OLD = Path(__file__).parent / 'data' / 'version_0_1_0'


# --- bags: of `dataset to-bag` (samples), of an evaluation (results), of `record` (recorded) ---

# What `evaluate samples --methods guided --source straight` said then: the topic of the method,
# and code, operation, storage, length and number of waypoints of its two plans.
SHORT, LONG = 36.21320343559643, 40.798989873223334
RESULTS = {
    'astar': [('NONE', 405, 453, LONG, 0), ('NONE', 292, 305, SHORT, 0)],
    'guided': [('NONE', 35, 138, LONG, 0), ('NONE', 86, 171, SHORT, 0)],
    'guided_straight': [('NONE', 35, 137, LONG, 3), ('NONE', 206, 305, SHORT, 3)],
}
POSES = [36, 31]
SAME_OF_GUIDED = ('map', 'pair', 'scale', 'method', 'source', 'prompt', 'model', 'code')


def messages_of(bag, topic):
    assert topic in bag.topics
    return [message.value for message in bag.messages([topic])]


def evaluated(bag, out, *options):
    """Evaluate a bag with today's code; return the rows of its results."""
    assert main(['evaluate', str(bag), *options, '--out', str(out)]) == 0
    with (out / 'results.csv').open() as file:
        return list(csv.DictReader(file))


def test_an_old_bag_of_samples_gives_the_same_plans(tmp_path):
    rows = evaluated(OLD / 'samples', tmp_path, '--methods', 'guided', '--source', 'straight')
    for topic, plans in RESULTS.items():
        method, _, source = topic.partition('_')
        own = [row for row in rows if (row['method'], row['source']) == (method, source or 'none')]
        assert [row['code'] for row in own] == [plan[0] for plan in plans]
        counts = [(float(row['operation']), float(row['storage'])) for row in own]
        if method == 'guided':  # its search has changed since: fewer states
            assert all(row[1] <= plan[2] for row, plan in zip(counts, plans))
        else:
            assert counts == [plan[1:3] for plan in plans]
        assert [float(row['length']) for row in own] == pytest.approx([plan[3] for plan in plans])
        assert [(row['map'], row['pair']) for row in own] == [('50', '0'), ('50', '1')]


def test_a_bag_of_the_same_samples_is_written_as_before(tmp_path):
    samples = load_samples(find_file('samples_1000.json', 'maps'), '50')[:2]
    write_sample_bag(samples, tmp_path / 'samples')
    files = [folder / 'samples' / 'metadata.yaml' for folder in (tmp_path, OLD)]
    named = f'ros_distro: {ros_distro()}'  # 0.1.0 wrote the name of the library
    assert files[0].read_text() == files[1].read_text().replace('ros_distro: rosbags', named)
    with Bag(tmp_path / 'samples') as new, Bag(OLD / 'samples') as old:
        assert new.topics == old.topics
        for mine, theirs in zip(new.messages(new.topics), old.messages(old.topics), strict=True):
            assert (mine.topic, mine.time) == (theirs.topic, theirs.time)
            assert str(mine.value) == str(theirs.value)


@pytest.mark.parametrize('topic', RESULTS)
def test_an_old_bag_of_results_holds_the_same_plans_and_reports(topic):
    with Bag(OLD / 'results') as bag:
        paths = messages_of(bag, f'/evaluation/{topic}/plan')
        markers = messages_of(bag, f'/evaluation/{topic}/markers')
        reports = [
            report_from_message(message, PlanReport)
            for message in messages_of(bag, f'/evaluation/{topic}/report')
        ]
        assert not bag.problems.lines()
    assert [len(path.poses) for path in paths] == POSES
    assert [len(array.markers[0].points) for array in markers] == [
        plan[4] for plan in RESULTS[topic]
    ]
    assert [
        (r.code_name, r.operation, r.storage, r.length, len(r.waypoints)) for r in reports
    ] == [(*plan[:3], pytest.approx(plan[3]), plan[4]) for plan in RESULTS[topic]]


def test_an_old_recording_holds_the_same_report_and_exchange():
    with Bag(OLD / 'recorded.mcap') as bag:
        (report,) = messages_of(bag, '/planner_node/report')
        (exchange,) = messages_of(bag, '/llm_client_node/exchange')
        assert len(messages_of(bag, '/planner_node/get_plan/_service_event')) == 2
        assert not bag.problems.lines()
    plan = report_from_message(report, PlanReport)
    assert (plan.code_name, plan.operation, len(plan.waypoints)) == ('NONE', 49, 3)
    asked = report_from_message(exchange, ExchangeReport)
    assert (asked.status, asked.pair, asked.waypoints) == (
        'OK', '39,18->7,19', ((31.0, 10.0), (27.0, 9.0), (10.0, 10.0)),
    )  # fmt: skip


def test_an_old_recording_is_replayed_and_gives_the_plan_it_holds(tmp_path):
    options = ('--methods', 'llm_astar', '--source', 'replay', '--corner-cutting')
    rows = evaluated(OLD / 'recorded.mcap', tmp_path, *options)
    (row,) = [row for row in rows if row['source'] == 'replay']
    assert row['path'] == row['recorded_path'] != ''
    assert row['waypoints'] == row['recorded_waypoints'] == '31,10;27,9;10,10'
    assert (row['recorded_code'], row['recorded_problem'], row['operation']) == (
        'NONE',
        '',
        '49.0',
    )
    assert len((tmp_path / 'exchanges.jsonl').read_text().splitlines()) == 1


# --- results folders: `bench --maps 0-2 --limit 6 --methods llm_only,llm_astar,guided --source
# oracle` (benchmark), `evaluate samples --methods guided --source straight --robot-radius 0.6
# --tolerance 0.5` (evaluation) ---

BENCH = ('--map-ids', '0-2', '--limit', '6', '--methods', 'waypoints_only,llm_astar,guided')
FOLDERS = {
    'benchmark': ('bench', *BENCH, '--source', 'oracle'),
    'evaluation': (
        'evaluate', str(OLD / 'samples'), '--methods', 'guided', '--source', 'straight',
        '--robot-radius', '0.6', '--tolerance', '0.5', '--unknown-cost', '0',
    ),
}  # fmt: skip


def old_folder(name, tmp_path):
    """Return a copy of an old results folder."""
    return Path(shutil.copytree(OLD / name, tmp_path / name))


def untimed(path):
    """Return the rows of a results.csv without their times, methods by their present names.

    Columns that are newer than the old files must be empty. Of `guided`, whose search has
    changed since, only what it was asked and how that ended is kept.
    """
    with path.open() as file:
        rows = list(csv.DictReader(file))
    assert not any(row.get(name) for row in rows for name in ADDED_COLUMNS)
    left_out = {'seconds_source', 'seconds_search', *ADDED_COLUMNS}
    return [
        {
            name: value.replace('llm_only', 'waypoints_only')
            for name, value in row.items()
            if (name in SAME_OF_GUIDED if row['method'] == 'guided' else name not in left_out)
        }
        for row in rows
    ]


def without_intervals(value):
    """Leave out what is newer: intervals by Student's t for few maps, and counts of failures.

    And the cost, which has gone: no old run had a price.
    """
    newer = ('low', 'high', 'headline', 'sentences', 'failures', 'optimal_share', 'cost')
    if isinstance(value, dict):
        kept = {name: item for name, item in value.items() if name not in newer}
        ratios = {'over_none', 'over_plain'} & kept.keys()
        return {
            name: [first_of_lists(item) for item in items]
            if name in ratios
            else without_intervals(items)
            for name, items in kept.items()
        }
    return [without_intervals(item) for item in value] if isinstance(value, list) else value


def first_of_lists(ratio):
    """Return a comparison with the value alone of each [value, low, high]."""
    return {
        name: item[0] if isinstance(item, list) else item
        for name, item in ratio.items()
        if name not in ('failures', 'asked', 'answered')
    }


@pytest.mark.parametrize('name', FOLDERS)
def test_an_old_results_folder_is_reported_with_the_same_figures(name, tmp_path):
    folder = old_folder(name, tmp_path)
    (folder / 'summary.json').unlink()
    assert main(['report', str(folder)]) == 0
    text = (OLD / name / 'summary.json').read_text().replace('llm_only', 'waypoints_only')
    found = json.loads((folder / 'summary.json').read_text())
    assert without_intervals(found) == without_intervals(json.loads(text))
    assert (folder / 'report.md').is_file()
    assert (folder / 'report.html').is_file()


def test_old_rows_of_llm_only_are_rows_of_waypoints_only():
    rows = ResultsFolder(OLD / 'benchmark').read()
    assert Counter(row.method for row in rows) == {
        'astar': 6, 'waypoints_only': 6, 'llm_astar': 12, 'guided': 12,
    }  # fmt: skip
    assert all(row.found for row in rows)


@pytest.mark.parametrize('name', FOLDERS)
def test_an_old_run_is_resumed_by_its_own_version_alone(name, tmp_path, monkeypatch, capsys):
    folder = old_folder(name, tmp_path)
    results = folder / 'results.csv'
    words = [*FOLDERS[name], '--out', str(folder), '--resume']
    lines = results.read_text().splitlines(keepends=True)
    results.write_text(''.join(lines[:-2]))
    monkeypatch.setattr(llm_astar_planner, '__version__', '9.9.9')
    assert main(words) == 2
    assert 'version (0.1.0 before, 9.9.9 now)' in capsys.readouterr().err
    assert results.read_text() == ''.join(lines[:-2])
    monkeypatch.setattr(llm_astar_planner, '__version__', '0.1.0')
    assert main(words) == 0
    assert untimed(results) == untimed(OLD / name / 'results.csv')


def test_the_same_run_has_the_same_rows_today(tmp_path):
    out = tmp_path / 'out'
    limit = ('--fail-under', 'waypoints_only/oracle:valid=100')
    assert main(['bench', *BENCH, '--source', 'oracle', '--out', str(out), *limit]) == 0
    assert untimed(out / 'results.csv') == untimed(OLD / 'benchmark' / 'results.csv')
    assert 'llm_only' not in (out / 'results.csv').read_text()


# --- transcripts: `llm_client_node` or `llm-astar plan` with `record` (transcript.jsonl) ---

TRANSCRIPT = OLD / 'transcript.jsonl'
ON_THE_DEMO = ((39.0, 18.0), (31.0, 10.0), (27.0, 9.0), (12.0, 9.0), (7.0, 19.0))
ON_A_COARSE_LATTICE = ((4.0, 4.0), (60.0, 20.0), (115.0, 100.0))


def big_map():
    """Return the map that the last exchange is about: no straight barriers describe it exactly."""
    cells = np.zeros((110, 120), dtype=np.int8)
    cells[np.arange(100), np.arange(100) + 10] = 100
    return GridMap(cells, 0.05)


def test_an_old_transcript_holds_the_same_exchanges(tmp_path):
    exchanges = read_transcript(TRANSCRIPT)
    assert [(e.map, e.pair, e.unit, e.status.value) for e in exchanges] == [
        (0, 0, 1, 'OK'),
        (0, 1, 1, 'MALFORMED'),
        (big_map().digest, '4,4->115,100', 2, 'OK'),
    ]
    assert [len(exchange.messages) for exchange in exchanges] == [1, 3, 1]
    assert exchanges[1].response == 'Sorry.'
    copy = TranscriptWriter(tmp_path / 'copy.jsonl')
    for exchange in exchanges:
        copy.write(exchange.to_json())
    assert copy.path.read_text() == TRANSCRIPT.read_text()


@pytest.mark.parametrize(
    ('start', 'goal', 'waypoints'),
    [
        ((39, 18), (7, 19), ON_THE_DEMO),
        ((7, 19), (39, 18), ()),
        ((4, 4), (115, 100), ON_A_COARSE_LATTICE),
    ],
)
def test_an_old_transcript_is_replayed_to_the_same_waypoints(start, goal, waypoints):
    dataset = load_barrier_maps(find_file('demo.json', 'maps'))
    grid_map = big_map() if waypoints is ON_A_COARSE_LATTICE else dataset[0].to_grid()
    query = WaypointQuery(Costmap(grid_map), start, goal)
    source = make_source(SourceSettings(source='replay', transcript=str(TRANSCRIPT)), dataset)
    reply = source.waypoints(query)
    assert reply.waypoints == waypoints
    assert reply.label == 'replay:tiny'
    assert reply.status.value == ('OK' if waypoints else 'MALFORMED')


def test_the_shipped_transcript_is_of_that_version_and_is_replayed():
    dataset = load_barrier_maps(find_file('demo.json', 'maps'))
    transcript = str(find_file('demo_transcript.jsonl', 'maps'))
    source = make_source(SourceSettings(source='replay', transcript=transcript), dataset)
    query = WaypointQuery(Costmap(dataset[0].to_grid()), (39, 18), (7, 19))
    assert source.waypoints(query).waypoints == ON_THE_DEMO


# --- parameter files: config/planner.yaml, but for two parameters that there are no more ---

GONE = ('remember_plans', 'lifecycle')
# Since then a robot inside the marks of an obstacle plans its way out.
CHANGED = {'start_tolerance': 0.0, 'source': 'embedded'}
PARAMETERS = OLD / 'planner.yaml'


@pytest.fixture
def parameters(tmp_path):
    """The file without these two."""
    lines = PARAMETERS.read_text().splitlines()
    kept = [line for line in lines if not line.strip().startswith(GONE)]
    assert len(lines) - len(kept) == len(GONE)
    path = tmp_path / 'planner.yaml'
    path.write_text('\n'.join(kept))
    return str(path)


def test_a_parameter_that_there_is_no_more_is_named_with_its_file():
    with pytest.raises(ParameterError) as refused:
        read_parameter_files([PARAMETERS])
    message = f'{PARAMETERS}: {GONE[0]}: planner_node has no parameter of this name'
    assert str(refused.value).startswith(message)


def test_an_old_parameter_file_is_planned_by(parameters, capsys):
    assert main(['plan', '--params-file', parameters, '--json']) == 0
    out, err = capsys.readouterr()
    assert json.loads(out)['method'] == 'guided'
    assert err == ''


def test_an_old_parameter_file_says_what_the_defaults_are_today(parameters):
    for node, values in read_parameter_files([parameters]).items():
        known = defaults(NODES[node]) | CHANGED
        assert values == {name: known[name] for name in values}
        assert len(values) > 2


def test_bags_are_evaluated_by_an_old_parameter_file(parameters, tmp_path):
    (bag,) = [OLD / 'recorded.mcap']
    rows = evaluated(bag, tmp_path, '--params-file', parameters, '--source', 'straight')
    assert {row['method'] for row in rows} == {'astar', 'guided'}


def test_a_node_starts_with_an_old_parameter_file(parameters):
    with process('planner_node', '--params-file', parameters, namespace=ALONE) as node:
        wait_for(lambda: 'ready; waiting for a map' in ''.join(node.output), 'the planner')
