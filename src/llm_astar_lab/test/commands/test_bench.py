"""`llm-astar bench`, `dataset` and `report` as a user runs them."""

import csv
import hashlib
import json
import os
import signal
import subprocess
import sys
from collections import defaultdict
from pathlib import Path

import numpy as np
import pytest
from llm_astar_lab.commands import bench as cli_bench
from llm_astar_lab.datasets.generate import generate
from llm_astar_lab.results.row import ResultsError, parse_points
from llm_astar_msgs_adapter.maps.barrier_map import load_barrier_maps
from llm_astar_msgs_adapter.maps.problem_maps import save_maps
from llm_astar_planner.cli.main import parse
from llm_astar_planner.resources import find_file
from llm_astar_planner.waypoints.source import SourceStatus
from llm_astar_planner.waypoints.transcript import Exchange, TranscriptWriter

PUBLISHED_FIGURES = (
    Path(__file__).parents[3] / 'llm_astar_planner' / 'test' / 'search' / 'published_figures.csv'
)


def llm_astar(*words):
    """Run a command in this process and return its exit code."""
    args = parse([str(word) for word in words])
    return args.run(args)


def record(path, exchanges, model='parrot'):
    """Write a transcript of (map, pair, response)."""
    writer = TranscriptWriter(path)
    for map_id, pair, text in exchanges:
        ok = SourceStatus.OK
        exchange = Exchange(map_id, pair, 1, model, 'few_shot', (), text, 7, 5, 0.1, ok)
        writer.write(exchange.to_json())


@pytest.fixture(scope='module')
def dataset(tmp_path_factory):
    path = tmp_path_factory.mktemp('dataset') / 'maps.json'
    save_maps(list(generate(9, 4)), path)
    return path


@pytest.fixture
def out(tmp_path):
    return tmp_path / 'out'


def test_the_whole_table_needs_no_key(dataset, out, capsys):
    assert llm_astar('bench', '--map', dataset, '--out', out, '--scales', '1-2') == 0
    printed = capsys.readouterr()
    assert 'Operation ratio' in printed.out
    assert 'The waypoints' in printed.out
    assert 'report.html' in printed.err
    with (out / 'results.csv').open() as file:
        rows = list(csv.DictReader(file))
    cases = {(row['method'], row['source']) for row in rows}
    assert len(rows) == len(cases) * (40 + 10)
    assert {
        ('llm_astar', 'random'),
        ('waypoints_only', 'oracle'),
        ('weighted_astar', 'none'),
    } < cases
    assert {('waypoints_only', 'embedded'), ('guided', 'embedded-best-of-8')} < cases
    metadata = json.loads((out / 'metadata.json').read_text())
    assert metadata['parameters']['jobs'] == 1
    assert metadata['seconds'] > 0
    for name in ('summary.json', 'report.md', 'report.html'):
        assert (out / name).is_file()


def test_zones_are_on_the_map_of_every_sample(dataset, out, tmp_path, capsys):
    zones = tmp_path / 'zones.geojson'
    ring = [[0, 0], [60, 0], [60, 40], [0, 40], [0, 0]]
    geometry = {'type': 'Polygon', 'coordinates': [ring]}
    rule = {'kind': 'one_way', 'heading': 0}
    feature = {'type': 'Feature', 'geometry': geometry, 'properties': rule}
    zones.write_text(json.dumps({'type': 'FeatureCollection', 'features': [feature]}))
    words = ('--map', dataset, '--out', out, '--methods', 'exact_astar,guided', '--limit', 12)
    assert llm_astar('bench', *words, '--zones', zones) == 0
    capsys.readouterr()
    with (out / 'results.csv').open() as file:
        rows = [row for row in csv.DictReader(file) if row['code'] == 'NONE']
    paths = [np.array(parse_points(row['path'])) for row in rows]
    assert len(paths) > 5
    assert all((np.diff(path[:, 0]) >= 0).all() for path in paths)
    with pytest.raises(ValueError, match='--zones is about metres'):
        llm_astar('bench', *words[:2], '--out', tmp_path / 'b', '--zones', zones, '--scales', '2')


def test_many_jobs_give_the_same_figures(dataset, tmp_path, capsys):
    tables = []
    for jobs in (1, 4):
        folder = tmp_path / str(jobs)
        words = ('--jobs', jobs, '--methods', 'llm_astar', '--map-ids', '0-1', '--json')
        assert llm_astar('bench', '--map', dataset, '--out', folder, *words) == 0
        summary = json.loads(capsys.readouterr().out)
        tables.append([(case['case'], case['operation']) for case in summary['cases']])
    assert tables[0] == tables[1]


def test_a_replay_is_named_by_its_model_and_baselines_are_added(dataset, out, tmp_path, capsys):
    transcript = tmp_path / 'replies.jsonl'
    record(transcript, [(0, pair, 'Generated Path: [[25, 15]]') for pair in range(10)])
    words = ('--source', 'replay', '--transcript', transcript, '--map-ids', '0', '--json')
    assert llm_astar('bench', '--map', dataset, '--out', out, *words) == 0
    summary = json.loads(capsys.readouterr().out)
    cases = {case['case']: case for case in summary['cases']}
    model = cases['llm_astar/replay/few_shot/parrot']
    assert (model['prompt_tokens'], model['completion_tokens']) == (70, 50)
    assert {'llm_astar/oracle', 'waypoints_only/replay/few_shot/parrot'} < set(cases)
    assert 'parrot' in summary['headline']
    digests = json.loads((out / 'metadata.json').read_text())['files']
    assert digests == {'replies.jsonl': hashlib.sha256(transcript.read_bytes()).hexdigest()}


def test_all_samples_of_a_transcript_that_lacks_some_are_incomplete_and_it_says_which(
    dataset, out, tmp_path, capsys
):
    transcript = tmp_path / 'replies.jsonl'
    record(transcript, [(0, pair, 'Generated Path: [[25, 15]]') for pair in range(8)])
    words = ('bench', '--map', dataset, '--out', out, '--map-ids', '0', '--methods', 'llm_astar')
    replay = ('--source', 'replay', '--transcript', transcript, '--samples', 'all')
    assert llm_astar(*words, *replay) == 3
    error = capsys.readouterr().err
    assert '2 samples without an answer (MISSING 2), the first map 0, pair 8' in error
    record(transcript, [(0, pair, 'Generated Path: [[25, 15]]') for pair in (8, 9)])
    assert llm_astar(*words, *replay, '--resume') == 0
    assert '2 of 2 samples' in capsys.readouterr().err


def test_a_live_endpoint_is_recorded_and_its_transcript_replays_the_same(
    dataset, out, tmp_path, capsys, chat_server
):
    live = ('--base-url', chat_server.base_url, '--model', 'parrot-1', '--prompt', 'few_shot,cot')
    words = ('bench', '--map', dataset, '--map-ids', '1', '--methods', 'llm_astar', '--json')
    assert llm_astar(*words, '--source', 'endpoint', '--out', out, *live) == 0
    summary = json.loads(capsys.readouterr().out)
    cases = {case['case']: case for case in summary['cases']}
    assert len(chat_server.requests) == 20
    assert cases['llm_astar/endpoint/cot/parrot-1']['prompt_tokens'] == 1000
    metadata = json.loads((out / 'metadata.json').read_text())
    assert set(metadata['files']) == {'few_shot.txt', 'cot.txt'}
    assert metadata['parameters']['jobs'] == 8
    transcript = out / 'transcript.jsonl'
    assert len(transcript.read_text().splitlines()) == 20
    replay = ('--source', 'replay', '--transcript', transcript, '--out', tmp_path / 'again')
    assert llm_astar(*words, *replay) == 0
    again = {case['case']: case for case in json.loads(capsys.readouterr().out)['cases']}
    for prompt in ('few_shot', 'cot'):
        replayed = again[f'llm_astar/replay/{prompt}/parrot-1']
        asked = cases[f'llm_astar/endpoint/{prompt}/parrot-1']
        for metric in ('operation', 'storage', 'length', 'verdicts', 'completion_tokens'):
            assert replayed[metric] == asked[metric]


def test_an_endpoint_that_fails_is_incomplete_and_resumed(dataset, out, chat_server, capsys):
    chat_server.script = [chat_server.error(401, 'who are you')]
    live = ('--base-url', chat_server.base_url, '--model', 'parrot-1', '--source', 'endpoint')
    words = ('bench', '--map', dataset, '--map-ids', '1', '--methods', 'llm_astar')
    assert llm_astar(*words, '--out', out, *live) == 3
    assert '10 samples without an answer (AUTH 10)' in capsys.readouterr().err
    chat_server.script = [chat_server.completion('Generated Path: [[25, 15]]')]
    assert llm_astar(*words, '--out', out, *live, '--resume') == 0


def test_a_missed_threshold_is_exit_code_one(dataset, out, capsys):
    words = ('bench', '--map', dataset, '--map-ids', '0', '--methods', 'llm_astar')
    sources = ('--source', 'oracle', '--out', out)
    limit = ('--fail-under', 'llm_astar/oracle:operation=1')
    assert llm_astar(*words, *sources, *limit) == 1
    assert 'is above 1' in capsys.readouterr().err


def test_ctrl_c_keeps_the_rows_and_resume_finishes(dataset, out, capsys, monkeypatch):
    words = ('bench', '--map', dataset, '--out', out, '--map-ids', '0', '--methods', 'llm_astar')
    append, calls = cli_bench.ResultsFolder.append, []

    def interrupted(folder, rows):
        append(folder, rows)
        calls.append(rows)
        if len(calls) == 4:
            raise KeyboardInterrupt

    monkeypatch.setattr(cli_bench.ResultsFolder, 'append', interrupted)
    assert llm_astar(*words) == 130
    assert 'continue with --resume' in capsys.readouterr().err
    assert (out / 'report.md').is_file()
    monkeypatch.undo()
    assert llm_astar(*words, '--resume') == 0
    assert '6 of 6 samples' in capsys.readouterr().err


def test_a_full_disk_ends_the_run_and_is_named(dataset, out, capsys, monkeypatch):
    def full(self, rows):
        message = 'out/results.csv: No space left on device'
        raise cli_bench.ResultsError(message)

    monkeypatch.setattr(cli_bench.ResultsFolder, 'append', full)
    assert llm_astar('bench', '--map', dataset, '--out', out, '--map-ids', '0') == 3
    assert 'No space left on device' in capsys.readouterr().err


def test_an_earlier_run_is_never_overwritten(dataset, out, capsys):
    words = ('bench', '--map', dataset, '--out', out, '--map-ids', '0', '--methods', 'astar')
    assert llm_astar(*words) == 0
    rows = (out / 'results.csv').read_bytes()
    assert llm_astar(*words) == 2
    assert 'replace it with --overwrite, or name another' in capsys.readouterr().err
    assert (out / 'results.csv').read_bytes() == rows
    assert llm_astar(*words, '--overwrite', '--limit', '2') == 0
    assert len((out / 'results.csv').read_text().splitlines()) == 3


def test_a_run_resumed_with_other_maps_keeps_the_maps_of_its_rows(dataset, out):
    words = ('bench', '--map', dataset, '--out', out, '--methods', 'guided', '--limit', '2')
    assert llm_astar(*words, '--map-ids', '0') == 0
    assert llm_astar(*words, '--map-ids', '2', '--resume') == 0
    assert [item['id'] for item in json.loads((out / 'maps.json').read_text())] == [2, 0]


def test_parts_of_several_machines_make_one_run(dataset, out, capsys, monkeypatch):
    words = ('bench', '--map', dataset, '--methods', 'guided', '--source', 'none')
    other = out.with_name('other')
    assert llm_astar(*words, '--map-ids', '0-1', '--out', out) == 0
    assert llm_astar(*words, '--map-ids', '2-3', '--out', other) == 0
    with (out / 'results.csv').open('a') as joined:
        joined.writelines((other / 'results.csv').read_text().splitlines(keepends=True)[1:])
    capsys.readouterr()
    monkeypatch.setattr(cli_bench.ResultsFolder, 'append', None)  # nothing is run again
    assert llm_astar(*words, '--out', out, '--resume', '--json') == 0
    cases = json.loads(capsys.readouterr().out)['cases']
    assert [case['samples'] for case in cases] == [40, 40]


@pytest.mark.parametrize(
    ('words', 'part'),
    [
        (('--methods', 'dijkstra'), "--methods 'dijkstra' is not one of guided"),
        (('--source', 'tea_leaves'), "--source 'tea_leaves' is not one of auto"),
        (('--source', 'replay'), 'transcript'),
        (('--source', 'endpoint'), '--model'),
        (('--source', 'endpoint', '--model', 'm', '--prompt', 'haiku'), 'haiku'),
        (('--scales', 'x'), '--scales'),
        (('--scales', '0-2'), '--scales 0-2'),
        (('--map-ids', '90-99'), '--map-ids 90-99'),
        (('--methods', 'gudied'), r'llm_astar, waypoints_only; did you mean guided\?'),
        (('--maps', '3'), '--maps: needs --dataset .*; --map-ids names maps by number'),
        (('--weight', '0.5'), '--weight'),
        (('--max-planning-time', '0'), '--max-planning-time'),
    ],
)
def test_bad_usage_is_named(dataset, out, words, part):
    with pytest.raises(ValueError, match=part):
        llm_astar('bench', '--map', dataset, '--out', out, *words)


def test_a_malformed_dataset_is_named_with_its_field(tmp_path, out):
    path = tmp_path / 'bad.json'
    path.write_text('[{"id": 4, "range_x": [0, 51], "range_y": "x"}]')
    with pytest.raises(ValueError, match=r'bad\.json: map at index 0 \(id 4\): range_y'):
        llm_astar('bench', '--map', path, '--out', out)


def test_a_dataset_is_generated(tmp_path):
    path = tmp_path / 'made.json'
    words = ('--maps', 2, '--pairs', 3, '--size', 30, 20, '--seed', 5)
    assert llm_astar('dataset', 'generate', '--out', path, *words) == 0
    assert [len(m.samples) for m in load_barrier_maps(path)] == [3, 3]


def test_reports_are_rewritten_and_put_into_a_readme(dataset, out, tmp_path, capsys):
    llm_astar('bench', '--map', dataset, '--out', out, '--map-ids', '0')
    report = (out / 'report.md').read_text()
    (out / 'report.md').unlink()
    assert llm_astar('report', out) == 0
    assert (out / 'report.md').read_text() == report
    readme = tmp_path / 'README.md'
    readme.write_text('<!-- results:begin -->\n<!-- results:end -->\n')
    assert llm_astar('report', out, '--readme', readme) == 0
    assert '| LLM-A* | oracle | - |' in readme.read_text()
    with pytest.raises(ResultsError, match=r'metadata\.json'):
        llm_astar('report', tmp_path)


def test_replayed_replies_give_the_aggregates_of_the_published_code(out, tmp_path, capsys):
    """They equal those of its figures on 200 samples to four decimals of a percent."""
    with PUBLISHED_FIGURES.open() as file:
        published = list(csv.DictReader(file))
    numbers = {int(row['map']) for row in published}
    maps = load_barrier_maps(find_file('samples_1000.json', 'maps'))
    dataset, transcript = tmp_path / 'maps.json', tmp_path / 'golden.jsonl'
    save_maps([one for one in maps if one.id in numbers], dataset)
    figures, replies = defaultdict(list), defaultdict(list)
    for row in published:
        name = row['method'] if row['method'] != 'llm_astar' else row['source']
        points = [list(point) for point in parse_points(row['waypoints'])]
        figures[name].append(row)
        replies[name].append(
            (int(row['map']), int(row['pair']), f'Generated Path: {json.dumps(points)}')
        )
    names = ('none', 'oracle', 'noisy', 'reversed', 'random', 'hostile')
    for name in names:
        record(transcript, replies[name], model=name)
    words = (
        '--map', dataset, '--source', 'replay', '--out', out,
        '--methods', 'llm_astar,dynamic_weighted_astar', '--transcript', transcript, '--json',
    )  # fmt: skip
    assert llm_astar('bench', *words) == 0
    cases = {case['case']: case for case in json.loads(capsys.readouterr().out)['cases']}
    rows = {f'llm_astar/replay/few_shot/{name}': figures[name] for name in names}
    rows['llm_astar/none'] = figures['none']
    rows['dynamic_weighted_astar/none'] = figures['dynamic_weighted_astar']
    for case, golden in rows.items():
        assert cases[case]['samples'] == 200
        assert cases[case]['valid']['value'] == 1.0
        for metric in ('operation', 'storage', 'length'):
            ratios = [
                float(row[metric]) / float(plain[metric])
                for row, plain in zip(golden, figures['astar'])
            ]
            mean = 100 * np.exp(np.log(ratios).mean())
            assert 100 * cases[case][metric]['value'] == pytest.approx(mean, abs=5e-5)


def test_a_real_interrupt_ends_the_process_with_130(dataset, out):
    """The signal, not a raised exception: the process ends itself and its rows are whole."""
    script = (
        'import sys, signal\n'
        # Processes started in the background of a shell ignore the signal.
        'signal.signal(signal.SIGINT, signal.default_int_handler)\n'
        'from llm_astar_planner.cli.main import parse\n'
        'args = parse(sys.argv[1:])\n'
        'sys.exit(args.run(args))\n'
    )
    words = ['bench', '--map', str(dataset), '--out', str(out), '--scales', '1-9']
    command = [sys.executable, '-c', script, *words]
    with subprocess.Popen(command, stderr=subprocess.PIPE, text=True) as process:
        process.stderr.readline()  # the first samples are done
        process.send_signal(signal.SIGINT)
        _, error = process.communicate(timeout=60)
    assert process.returncode == 130
    assert 'interrupted: the rows so far are kept' in error
    lines = (out / 'results.csv').read_text().splitlines()
    assert len(lines) > 10
    assert len({line.count(',') for line in lines if '"' not in line}) == 1


def test_an_instruction_for_every_sample_fills_columns_and_is_a_threshold(dataset, out, capsys):
    words = ('bench', '--map', dataset, '--map-ids', '0', '--methods', 'guided')
    text = ('--source', 'straight', '--instruction', 'keep 1 m away from the walls; fly')
    assert llm_astar(*words, *text, '--out', out, '--assert', 'instruction=95') == 1
    assert 'instruction 0.00 % is below 95' in capsys.readouterr().err
    with (out / 'results.csv').open() as file:
        rows = list(csv.DictReader(file))
    assert rows
    for row in rows:
        assert row['instruction'].startswith('keep 1 m away from the walls: ')
        assert 'not understood: "fly"' in row['instruction']
        # What was not understood is never satisfied.
        assert row['instruction_satisfied'] == '0.0'
    with pytest.raises(ValueError, match='--instruction is about metres'):
        llm_astar(*words, *text, '--scales', '1-2', '--out', out.with_name('scaled'))


def test_a_terminal_that_writes_ascii_alone_gets_the_table(dataset, out):
    words = ('--map', dataset, '--out', out, '--limit', '1', '--methods', 'astar')
    process = subprocess.run(
        [sys.executable, '-m', 'llm_astar_planner.cli.main', 'bench', *map(str, words)],
        env=os.environ | {'PYTHONIOENCODING': 'ascii'},
        capture_output=True,
        text=True,
    )
    assert process.returncode == 0, process.stderr
    assert 'Operation ratio ? (%)' in process.stdout
