"""`llm-astar instruct-bench` as a user runs it: real maps, real planner, real grammar."""

import csv
import json

import pytest
from instruction_suites import write_suite
from llm_astar_lab.instruct_bench.runner import SuiteRunner
from llm_astar_planner.cli.main import main


@pytest.fixture
def suite(tmp_path):
    return str(write_suite(tmp_path))


def test_the_tables_compare_the_sources(suite, capsys):
    assert main(['instruct-bench', '--suite', suite, '--source', 'none', 'truth,grammar']) == 0
    lines = capsys.readouterr().out.splitlines()
    by_source = {line.split()[0]: line for line in lines[1:4]}
    assert list(by_source) == ['none', 'truth', 'grammar']
    assert '100.0 (56.6-100.0) 5/5' in by_source['truth']
    assert any(line.startswith('truth') and ' avoid ' in line for line in lines)


def test_the_check_of_claims_is_measured_by_itself(suite, capsys):
    assert main(['instruct-bench', '--suite', suite, '--check']) == 0
    lines = capsys.readouterr().out.splitlines()
    assert lines[0].startswith('| reading | ')
    assert [line.split(' | ')[0] for line in lines[2:4]] == ['| right', '| verb']


def test_a_run_is_written_as_rows_figures_and_report(suite, tmp_path, capsys):
    out = tmp_path / 'out'
    words = ['instruct-bench', '--suite', suite, '--source', 'truth', 'grammar']
    assert main([*words, '--out', str(out), '--json']) == 0
    printed = json.loads(capsys.readouterr().out)
    assert printed['truth']['all']['satisfied'] == {
        'count': 2, 'of': 2, 'percent': 100.0, 'from': 34.24, 'to': 100.0,
    }  # fmt: skip
    assert printed['grammar']['all']['false_claims']['count'] == 0
    rows = list(csv.DictReader((out / 'results.csv').read_text().splitlines()))
    assert [(row['id'], row['source']) for row in rows[:2]] == [
        ('door', 'truth'),
        ('door', 'grammar'),
    ]
    assert rows[0]['fulfilled'] == '1'
    summary = json.loads((out / 'summary.json').read_text())
    assert summary['dataset']['file'] == 'suite.json'
    assert summary['sources'] == printed
    assert (out / 'report.md').read_text().startswith('# Instructions: suite.json')
    assert main([*words, '--out', str(out)]) == 2
    assert 'exists' in capsys.readouterr().err


def test_one_instruction_is_shown_in_full_and_drawn(suite, tmp_path, capsys):
    words = ['instruct-bench', '--suite', suite, '--show', 'door']
    assert main([*words, '--png', str(tmp_path / 'door.png')]) == 0
    text = capsys.readouterr().out
    assert 'understood  visit the north door' in text
    assert 'clause      visit the north door: kept' in text
    assert 'check       touch holds (touched)' in text
    assert (tmp_path / 'door.png').stat().st_size > 1000
    assert main([*words, '--source', 'none', 'truth', '--json']) == 0
    shown = json.loads(capsys.readouterr().out)
    assert [item['source'] for item in shown] == ['none', 'truth']
    assert shown[1]['outcome']['satisfied'] is True


def test_an_interrupted_run_keeps_its_rows(suite, tmp_path, monkeypatch, capsys):
    done, run_one = [], SuiteRunner.run_one

    def interrupted(runner, instruction, source):
        if len(done) == 3:
            raise KeyboardInterrupt
        done.append(instruction.id)
        return run_one(runner, instruction, source)

    monkeypatch.setattr(SuiteRunner, 'run_one', interrupted)
    out = tmp_path / 'out'
    assert main(['instruct-bench', '--suite', suite, '--source', 'none', '--out', str(out)]) == 130
    assert 'interrupted after 3 results' in capsys.readouterr().err
    rows = list(csv.DictReader((out / 'results.csv').read_text().splitlines()))
    assert [row['id'] for row in rows] == done


@pytest.mark.parametrize(
    ('words', 'message'),
    [
        (['--source', 'oracle'], "--source 'oracle' is unknown; available are truth, grammar"),
        (['--show', 'attic'], "has no instruction 'attic'"),
        (['--png', 'x.png'], '--png draws one plan'),
        (['--show', 'door', '--source', 'truth', 'none', '--png', 'x.png'], '--png draws one'),
        (['--source', 'replay'], 'name one'),
        (['--record', 'x.jsonl'], '--record keeps exchanges of --source endpoint'),
    ],
)
def test_bad_usage_is_refused(suite, words, message, capsys):
    assert main(['instruct-bench', '--suite', suite, *words]) == 2
    assert message in capsys.readouterr().err


def test_a_malformed_suite_is_refused_before_anything_runs(tmp_path, capsys):
    def change(suite):
        suite['instructions'][3]['goal'] = [99, 99]

    suite = write_suite(tmp_path, change)
    assert main(['instruct-bench', '--suite', str(suite), '--out', str(tmp_path / 'out')]) == 2
    assert "suite.json: instruction 'both': goal: (99, 99) lies off map" in capsys.readouterr().err
    assert not (tmp_path / 'out').exists()


@pytest.fixture
def indirect(tmp_path):
    """Write the suite with a sentence that only a model understands."""

    def change(suite):
        suite['instructions'][1]['text'] = 'hm, the south door, you know what I think of it'

    return str(write_suite(tmp_path, change))


def test_a_model_is_asked_recorded_and_replayed(indirect, tmp_path, chat_server, capsys):
    avoid = {'clauses': [{'kind': 'avoid', 'region': {'place': 'south door'}, 'strength': 'must'}]}
    chat_server.script = [chat_server.completion(json.dumps(avoid))]
    record = tmp_path / 'exchanges.jsonl'
    words = ['instruct-bench', '--suite', indirect, '--show', 'tür', '--json', '--model', 'm']
    live = ['--source', 'endpoint', '--base-url', chat_server.base_url, '--record', str(record)]
    assert main([*words, *live]) == 0
    (asked,) = json.loads(capsys.readouterr().out)
    assert 'avoid the south door' in asked['understood']
    assert asked['understood_by'] == 'm'
    assert asked['fulfilled'] == 1
    assert asked['output_tokens'] > 0
    assert len(chat_server.requests) == 1
    assert main([*words, '--source', 'replay', '--transcript', str(record)]) == 0
    (replayed,) = json.loads(capsys.readouterr().out)
    assert len(chat_server.requests) == 1
    for name in ('understood', 'exact', 'claimed', 'fulfilled', 'checks', 'output_tokens'):
        assert replayed[name] == asked[name]


def test_a_model_that_does_not_answer_leaves_the_run_incomplete(indirect, capsys):
    words = ['instruct-bench', '--suite', indirect, '--source', 'endpoint', '--max-retries', '0']
    assert main([*words, '--base-url', 'http://127.0.0.1:9/v1', '--timeout-s', '2']) == 3
    printed = capsys.readouterr()
    assert 'endpoint: 1 instructions without an answer, the first tür' in printed.err
    assert 'endpoint  5' in printed.out
