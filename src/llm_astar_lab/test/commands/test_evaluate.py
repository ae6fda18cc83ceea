"""`llm-astar evaluate` as a user runs it: from bags to a results folder and an exit code."""

import csv
import json
import math
from itertools import pairwise

import pytest
from bag_makers import (
    answer_at,
    as_sqlite3,
    call_at,
    exchange_at,
    goal_at,
    map_at,
    plan_at,
    report_at,
    room,
    start_at,
    write_bag,
)
from llm_astar_lab.bags import reading as bag_reading
from llm_astar_lab.bags.reading import Bag
from llm_astar_lab.datasets.generate import MapRules, generate
from llm_astar_lab.evaluation.tasks import SampleIdAllocator
from llm_astar_msgs_adapter.maps.barrier_map import load_barrier_maps
from llm_astar_msgs_adapter.maps.problem_maps import save_maps
from llm_astar_planner.cli.main import main

TIMES = {'seconds_source', 'seconds_search'}
OF_BAGS = {'bag', 'request', 'stamp', 'map_digest'}
WALLS = [(6, y) for y in range(1, 7)]
ROOM = room(20, 10, *WALLS)
WAY = [(2.0, 2.0), (5.0, 7.0), (7.0, 7.0), (8.0, 2.0)]
THROUGH = [(2.0, 2.0), (8.0, 2.0)]
CASES = ('--methods', 'guided', '--source', 'straight')


@pytest.fixture
def out(tmp_path):
    return tmp_path / 'out'


def llm_astar(*words):
    return main([str(word) for word in words])


def rows_in(folder):
    with (folder / 'results.csv').open(newline='') as file:
        return list(csv.DictReader(file))


def by_method(folder, method):
    return [row for row in rows_in(folder) if (row['method'], row['source']) == (method, 'none')]


def figures(folder, without=frozenset()):
    """Return rows by their key, without times and the columns given."""
    keys = ('map', 'pair', 'scale', 'method', 'source', 'prompt', 'model')
    return {
        tuple(row[key] for key in keys): {
            name: value for name, value in row.items() if name not in TIMES | without
        }
        for row in rows_in(folder)
    }


@pytest.fixture
def drive(tmp_path):
    """A bag of two calls, one of them answered by the robot's own stack through a wall."""
    return write_bag(tmp_path / 'drive', [
        map_at(1, ROOM),
        call_at(2, (2, 2), (8, 2), 1), answer_at(2.5, WAY, 1),
        call_at(3, (2, 2), (8, 2), 2), answer_at(3.5, THROUGH, 2),
    ])  # fmt: skip


def test_the_bag_of_a_dataset_gives_the_same_rows_as_the_benchmark(tmp_path):
    dataset = tmp_path / 'maps.json'
    save_maps(list(generate(9, 2, MapRules(pairs=4))), dataset)
    methods = ('--methods', 'exact_astar,waypoints_only,llm_astar,guided')
    assert llm_astar('bench', '--map', dataset, '--out', tmp_path / 'bench', *methods) == 0
    assert llm_astar('dataset', 'to-bag', '--map', dataset, '--out', tmp_path / 'mcap') == 0
    as_sqlite3(tmp_path / 'mcap', tmp_path / 'sqlite3')
    for storage in ('mcap', 'sqlite3'):
        out = tmp_path / f'{storage}_out'
        assert llm_astar('evaluate', tmp_path / storage, '--out', out, *methods) == 0
        assert figures(out, OF_BAGS) == figures(tmp_path / 'bench', OF_BAGS)
        assert {row['bag'] for row in rows_in(out)} == {storage}
    assert [item.id for item in load_barrier_maps(out / 'maps.json')] == [0, 1]


def test_plans_are_compared_with_those_of_the_robot(drive, out, capsys):
    limits = ('--fail-under', 'guided:valid=100', '--fail-under', 'guided:recorded=90')
    assert llm_astar('evaluate', drive, '--out', out, *CASES, *limits) == 1
    assert 'guided/none: recorded' in capsys.readouterr().err
    first, second = by_method(out, 'guided')
    length = sum(math.dist(a, b) for a, b in pairwise(WAY))
    assert float(first['recorded_length']) == pytest.approx(length)
    assert (first['recorded_problem'], second['recorded_length']) == ('', '6.0')
    assert second['recorded_problem'] == 'it hits an obstacle at (6, 2)'
    assert (first['clearance'], first['unknown_length']) == ('1.0', '0.0')
    assert float(first['turns']) == first['path'].count(';') - 1
    summary = json.loads((out / 'summary.json').read_text())
    case = next(case for case in summary['cases'] if case['case'] == 'guided/none')
    lengths = [float(row['length']) / float(row['recorded_length']) for row in (first, second)]
    assert case['recorded']['value'] == pytest.approx(math.sqrt(math.prod(lengths)))
    said = 'plan is in the bags for 2 of 2 requests; not valid on their map by these rules: 1 '
    text, page = (out / 'report.md').read_text(), (out / 'report.html').read_text()
    assert text.startswith('# Evaluation of bags: drive\n')
    assert said in text
    assert 'Length / recorded plan' in text
    assert '<h1>Evaluation of bags: drive</h1>' in page
    assert 'the paper, as printed' not in text + page
    assert '"drive, request 1","2,2;8,2"' in page


def test_the_rules_come_from_options_and_from_parameter_files_of_the_node(drive, tmp_path, capsys):
    file = tmp_path / 'planner.yaml'
    file.write_text(
        '/**/planner_node:\n  ros__parameters:\n    method: astar\n    corner_cutting: true\n'
    )

    def run(name, *options):
        assert llm_astar('evaluate', drive, '--out', tmp_path / name, *options) == 0
        return float(by_method(tmp_path / name, 'astar')[0]['length'])

    assert run('file', '--params-file', file) < run('own', '--methods', 'astar')
    assert run('both', '--params-file', file, '--no-corner-cutting') > run('on', '--methods',
               'astar', '--corner-cutting')  # fmt: skip
    file.write_text('planner_node: {ros__parameters: {robot_radius: wide}}')
    assert llm_astar('evaluate', drive, '--out', tmp_path / 'x', '--params-file', file) == 2
    assert 'planner.yaml: robot_radius: float is expected' in capsys.readouterr().err


def test_a_flag_overrides_a_parameter_file_even_with_the_default_of_the_flag(drive, tmp_path):
    file = tmp_path / 'planner.yaml'
    file.write_text(
        'planner_node: {ros__parameters: {weight: 5.0, max_suboptimality: 1.5, method: guided}}'
    )

    def parameters(name, *options):
        out = tmp_path / name
        assert llm_astar('evaluate', drive, '--out', out, '--params-file', file, *options) == 0
        return json.loads((out / 'metadata.json').read_text())['parameters']

    by_file = parameters('file')
    assert (by_file['weight'], by_file['max_suboptimality']) == (5.0, 1.5)
    assert (by_file['methods'], by_file['time_limit']) == (['guided'], 5.0)
    by_flags = parameters('flags', '--max-suboptimality', '0', '--max-planning-time', '60')
    assert (by_flags['weight'], by_flags['max_suboptimality']) == (5.0, None)
    assert by_flags['time_limit'] == 60.0


def test_source_none_asks_no_source(drive, out):
    cases = ('--methods', 'guided', '--source', 'none')
    assert llm_astar('evaluate', drive, *cases, '--out', out) == 0
    assert {row['source'] for row in rows_in(out)} == {'none'}


def test_a_robot_that_does_not_fit_gets_no_plan(drive, out):
    assert llm_astar('evaluate', drive, '--out', out, *CASES, '--robot-radius', '3') == 0
    assert {row['code'] for row in rows_in(out)} == {'START_OCCUPIED'}


def test_recorded_exchanges_are_replayed_and_give_the_same_plans(tmp_path, out, monkeypatch):
    opened = []
    monkeypatch.setattr(bag_reading, 'Bag', lambda path: opened.append(path) or Bag(path))
    points = [[6.0, 7.0], [7.0, 7.0]]
    exchange = {
        'map_digest': ROOM.digest, 'pair': '2,2->8,2', 'model': 'small', 'prompt': 'few_shot',
        'messages': [['user', 'where?']], 'text': f'Path: {points}', 'waypoints': points,
        'status': 'OK', 'unit': 1, 'prompt_tokens': 9, 'completion_tokens': 5, 'seconds': 0.5,
    }  # fmt: skip
    bag = write_bag(tmp_path / 'field', [
        map_at(1, ROOM), start_at(1.5, (2, 2)), goal_at(2, (8, 2)),
        exchange_at(2.1, **exchange), plan_at(2.2, WAY, 2.05),
        report_at(2.3, 'NONE', [[6.0, 7.0, 'accepted'], [7.0, 7.0, 'accepted']], 2.05),
    ])  # fmt: skip
    options = ('--methods', 'llm_astar', '--source', 'replay', '--out', out)
    assert llm_astar('evaluate', bag, *options) == 0
    (row,) = [row for row in rows_in(out) if row['source'] == 'replay']
    assert (row['prompt'], row['model'], row['source_status']) == ('few_shot', 'small', 'OK')
    assert row['waypoints'] == row['recorded_waypoints'] == '6,7;7,7'
    assert (row['recorded_code'], row['prompt_tokens']) == ('NONE', '9')
    assert len((out / 'exchanges.jsonl').read_text().splitlines()) == 1
    # Opening reads a whole index: exchanges and requests are read from the same open bag.
    assert opened == [str(bag)]


def test_replay_of_a_bag_without_exchanges_is_bad_usage(drive, out, capsys):
    assert llm_astar('evaluate', drive, '--source', 'replay', '--out', out) == 2
    assert 'the bags hold no exchanges' in capsys.readouterr().err


def test_what_is_left_out_is_reported_and_the_rest_is_evaluated(drive, tmp_path, out, capsys):
    early = write_bag(tmp_path / 'early', [
        call_at(1, (2, 2), (8, 8), 1), map_at(2, ROOM), call_at(3, (2, 2), (8, 8), 2),
    ])  # fmt: skip
    (early / 'metadata.yaml').unlink()
    mapless = write_bag(tmp_path / 'mapless', [call_at(1, (2, 2), (8, 8))])
    (tmp_path / 'rubbish.mcap').write_text('rubbish')
    (tmp_path / 'cut.mcap').write_bytes((drive / 'drive_0.mcap').read_bytes()[:300])
    bags = (early, tmp_path / 'rubbish.mcap', tmp_path / 'cut.mcap', mapless,
            tmp_path / 'nowhere', drive)  # fmt: skip
    assert llm_astar('evaluate', *bags, *CASES, '--out', out) == 3
    errors = capsys.readouterr().err
    report = (out / 'report.md').read_text()
    left_out = json.loads((out / 'summary.json').read_text())['left_out']
    for sentence in (
        'a request before the first map', 'rubbish.mcap: does not begin as an mcap file does',
        'mapless: no map', 'nowhere: there is no such bag', 'cut.mcap: was cut off',
    ):  # fmt: skip
        assert sentence in errors
        assert sentence in report
        assert any(sentence in line for line in left_out)
    assert 'note: ' in errors
    assert [row['bag'] for row in by_method(out, 'guided')] == ['early', 'drive', 'drive']
    assert 'Left out' in (out / 'report.html').read_text()


def test_nothing_to_evaluate_still_leaves_a_report(tmp_path, out):
    bag = write_bag(tmp_path / 'mapless', [call_at(1, (2, 2), (8, 8))])
    assert llm_astar('evaluate', bag, '--out', out) == 3
    assert 'no map' in (out / 'report.md').read_text()


def test_an_interrupted_run_is_resumed_where_it_stopped(drive, out, capsys):
    assert llm_astar('evaluate', drive, *CASES, '--out', out) == 0
    whole = rows_in(out)
    lines = (out / 'results.csv').read_text().splitlines(keepends=True)
    (out / 'results.csv').write_text(''.join(lines[:3]) + lines[3][:10])
    assert llm_astar('evaluate', drive, *CASES, '--out', out) == 2
    assert 'continue it with --resume' in capsys.readouterr().err
    assert llm_astar('evaluate', drive, *CASES, '--out', out, '--resume') == 0
    assert len(rows_in(out)) == len(whole)
    changed = ('--resume', '--robot-radius', '1')
    assert llm_astar('evaluate', drive, *CASES, '--out', out, *changed) == 2
    assert 'rules' in capsys.readouterr().err


def test_the_same_map_in_two_bags_is_one_map_with_all_its_requests(drive, tmp_path, out):
    again = write_bag(tmp_path / 'again', [map_at(1, ROOM), call_at(2, (3, 3), (8, 8))])
    assert llm_astar('evaluate', drive, again, *CASES, '--out', out) == 0
    rows = by_method(out, 'guided')
    assert [(row['map'], row['pair'], row['bag'], row['request']) for row in rows] == [
        ('0', '0', 'drive', '0'), ('0', '1', 'drive', '1'), ('0', '2', 'again', '0'),
    ]  # fmt: skip


def test_samples_keep_their_numbers_and_repeated_ones_are_numbered_after_them():
    ids = SampleIdAllocator()
    assert [ids.map_id(digest, 7) for digest in ('a', 'b', 'a')] == [7, 8, 7]
    assert [ids.pair(7, wanted, 3) for wanted in (1, None, 0, 1, 2, None)] == [
        1,
        3,
        0,
        4,
        2,
        5,
    ]
    assert [ids.pair(8, wanted, 0) for wanted in (None, None)] == [0, 1]


def test_the_contents_of_bags_are_listed_as_text_and_as_json(drive, capsys):
    assert llm_astar('evaluate', drive, '--list') == 0
    text = capsys.readouterr().out
    assert '5 messages in 2.500 s' in text
    assert '/map' in text
    assert llm_astar('evaluate', drive, drive, '--list', '--json') == 0
    offers = json.loads(capsys.readouterr().out)
    assert [offer['bag'] for offer in offers] == ['drive', 'drive']


def test_corners_that_may_be_cut_where_barriers_are_known_are_rules_of_a_resumed_run(
    tmp_path, out, capsys
):
    dataset, bag = tmp_path / 'maps.json', tmp_path / 'bag'
    save_maps(list(generate(9, 1, MapRules(pairs=5))), dataset)
    assert llm_astar('dataset', 'to-bag', '--map', dataset, '--out', bag) == 0
    options = ('--methods', 'llm_astar', '--source', 'straight', '--out', out)
    assert llm_astar('evaluate', bag, *options) == 0
    assert llm_astar('evaluate', bag, *options, '--resume', '--no-corner-cutting') == 2
    assert 'these differ: paper_corners (True before)' in capsys.readouterr().err


@pytest.mark.parametrize(
    ('options', 'expected'),
    [
        (('--occupied-threshold', '0'), '--occupied-threshold: 0 is not in 1 to 100'),
        (('--plan-window', '-1'), "--plan-window: '-1' is not a number of at least 0"),
        (('--methods', 'magic'), "--methods 'magic' is not one of"),
        (
            ('--fail-under', 'giuded:valid=100'),
            'giuded: this run has no such variant; did you mean guided',
        ),
    ],
)
def test_bad_usage_is_one_line_and_exit_code_2(drive, out, capsys, options, expected):
    assert llm_astar('evaluate', drive, '--out', out, *options) == 2
    (line,) = capsys.readouterr().err.splitlines()
    assert expected in line
    assert not out.exists()


def test_a_bag_that_does_not_exist_leaves_nothing_behind(out, capsys):
    assert llm_astar('evaluate', 'nobag', '--out', out) == 2
    assert 'nobag: there is no such bag' in capsys.readouterr().err
    assert not out.exists()


def test_a_gate_runs_twice_without_naming_a_folder(drive, tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    gate = ('evaluate', drive, '--source', 'none', '--methods', 'guided')
    for folder in ('out/evaluate', 'out/evaluate-2'):
        assert llm_astar(*gate, '--fail-under', 'guided:valid=100') == 0
        assert f'{folder}/report.html' in capsys.readouterr().err


def test_the_exchanges_of_an_existing_folder_are_kept(drive, out):
    assert llm_astar('evaluate', drive, '--out', out, *CASES) == 0
    (out / 'exchanges.jsonl').write_text('of before')
    assert llm_astar('evaluate', drive, '--out', out, '--source', 'replay') == 2
    assert (out / 'exchanges.jsonl').read_text() == 'of before'


@pytest.mark.parametrize('seconds', [0, 9e9])
def test_requests_are_planned_at_any_time(tmp_path, out, seconds):
    topic, _, call = call_at(0, (2, 2), (8, 2))
    bag = write_bag(tmp_path / 'bag', [map_at(0, ROOM), (topic, seconds, call)])
    assert llm_astar('evaluate', bag, '--out', out, *CASES) == 0
    assert by_method(out, 'guided')[0]['code'] == 'NONE'


def test_a_recorded_path_of_enormous_length_is_not_checked_cell_by_cell(tmp_path, out):
    far = answer_at(2.5, [(2, 2), (9e7, 9e7), (8, 2)])
    bag = write_bag(tmp_path / 'bag', [map_at(1, ROOM), call_at(2, (2, 2), (8, 2)), far])
    assert llm_astar('evaluate', bag, '--out', out, *CASES) == 0
    assert 'cells long' in by_method(out, 'guided')[0]['recorded_problem']


def test_a_goal_whose_quaternion_is_zero_is_planned(tmp_path, out):
    goal = goal_at(3, (8, 2))
    goal[2].pose.orientation.w = 0.0
    bag = write_bag(tmp_path / 'bag', [map_at(1, ROOM), start_at(2, (2, 2)), goal])
    assert llm_astar('evaluate', bag, '--out', out, *CASES) == 0
    assert by_method(out, 'guided')[0]['code'] == 'NONE'


INSTRUCTION = {
    'summary': 'avoid the west: violated (3.0 m inside)',
    'satisfied': False,
    'clauses': [],
    'note': '',
    'interpretation': {
        'text': 'stay in the gallery',
        'status': 'understood',
        'understood_by': 'qwen',
        'specification': {'clauses': [{'kind': 'avoid', 'region': {'place': 'gallery'}}]},
    },
}


@pytest.fixture
def instructed(tmp_path):
    """A bag of two calls; the first was planned by an instruction, as its report says."""
    return write_bag(tmp_path / 'drive', [
        map_at(1, ROOM),
        call_at(2, (2, 2), (8, 2), 1), answer_at(2.5, WAY, 1),
        report_at(2.5, 'NONE', [], 2.5, instruction_report=INSTRUCTION),
        call_at(3, (2, 2), (8, 2), 2), answer_at(3.5, WAY, 2),
    ])  # fmt: skip


def gallery(tmp_path):
    """Return a places file with an area around the end of the wall of ROOM."""
    ring = [[4, 6.6], [9, 6.6], [9, 8.6], [4, 8.6], [4, 6.6]]
    feature = {
        'type': 'Feature',
        'geometry': {'type': 'Polygon', 'coordinates': [ring]},
        'properties': {'name': 'gallery'},
    }
    path = tmp_path / 'places.geojson'
    path.write_text(json.dumps({'type': 'FeatureCollection', 'features': [feature]}))
    return path


def test_a_recorded_instruction_is_asked_again_and_its_outcome_kept(instructed, tmp_path, out):
    words = (*CASES, '--places', gallery(tmp_path), '--out', out)
    assert llm_astar('evaluate', instructed, *words) == 0
    first, second = by_method(out, 'guided')
    assert (first['recorded_instruction'], first['recorded_instruction_satisfied']) == (
        INSTRUCTION['summary'],
        '0.0',
    )
    page = (out / 'report.html').read_text()
    assert '"places":[["gallery",' in page
    assert 'avoid the gallery: impossible' in page
    # The only way leads through the gallery.
    assert first['instruction'].startswith('avoid the gallery: impossible')
    assert first['instruction_satisfied'] == '0.0'
    assert not any(value for name, value in second.items() if 'instruction' in name)


def test_an_instruction_on_the_command_line_replaces_the_recorded_ones(
    instructed, tmp_path, out, capsys
):
    words = (*CASES, '--places', gallery(tmp_path), '--instruction', 'visit the gallery')
    limits = ('--assert', 'instruction=100', '--assert', 'recorded_instruction=50')
    assert llm_astar('evaluate', instructed, *words, '--out', out, *limits) == 1
    printed = capsys.readouterr()
    assert 'recorded_instruction 0.00 % is below 50' in printed.err
    assert ' instruction 100' not in printed.err
    assert 'Instruction kept (%)' in printed.out
    for row in by_method(out, 'guided'):
        assert row['instruction'].startswith('visit the gallery: kept')
        assert row['instruction_satisfied'] == '1.0'
    summary = json.loads((out / 'summary.json').read_text())
    (case,) = [case for case in summary['cases'] if case['case'] == 'guided/none']
    assert case['instruction']['value'] == 1.0
    assert case['recorded_instruction']['value'] == 0.0


@pytest.mark.parametrize(
    'report',
    [
        {'interpretation': {'text': 'x', 'specification': {'clauses': [{'kind': 'fly'}]}}},
        {'interpretation': {'text': 'x' * 501, 'specification': {'clauses': []}}},
        {'interpretation': 'x', 'satisfied': 'yes'},
        {},
        [],
        7,
    ],
)
def test_a_malformed_report_on_an_instruction_is_no_instruction(tmp_path, out, report):
    bag = write_bag(tmp_path / 'drive', [
        map_at(1, ROOM),
        call_at(2, (2, 2), (8, 2), 1), answer_at(2.5, WAY, 1),
        report_at(2.5, 'NONE', [], 2.5, instruction_report=report),
    ])  # fmt: skip
    assert llm_astar('evaluate', bag, *CASES, '--out', out) == 0
    (row,) = by_method(out, 'guided')
    assert row['recorded_code'] == 'NONE'
    assert row['instruction'] == ''
