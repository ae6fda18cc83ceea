"""`llm-astar transcript check`: malformed lines, missing samples, and what differs."""

import json
from dataclasses import replace

import pytest
from llm_astar_lab.datasets.generate import generate
from llm_astar_msgs_adapter.maps.barrier_map import load_barrier_maps
from llm_astar_msgs_adapter.maps.problem_maps import save_maps
from llm_astar_planner.cli.main import main
from llm_astar_planner.waypoints.replay import dataset_digest
from llm_astar_planner.waypoints.source import Provenance, SourceStatus
from llm_astar_planner.waypoints.transcript import Exchange, TranscriptWriter

GOOD = Exchange(
    0, 0, 1, 'parrot', 'few_shot', (), 'Generated Path: [[1, 2]]', 7, 5, 0.25, SourceStatus.OK
)
INSTRUCTION = {
    'text': 'keep left', 'places': '', 'model': 'parrot', 'reply': '{}', 'seconds': 1.0,
    'prompt_tokens': 1, 'output_tokens': 1,
}  # fmt: skip


@pytest.fixture
def dataset(tmp_path):
    path = tmp_path / 'maps.json'
    save_maps(list(generate(5, 2)), path)
    return path


def record(path, *exchanges):
    writer = TranscriptWriter(path)
    for exchange in exchanges:
        writer.write(exchange)
    return path


def whole(dataset, **provenance):
    """Return an exchange for every sample of a dataset."""
    known = Provenance(dataset_digest=dataset_digest(load_barrier_maps(dataset)), **provenance)
    return [
        replace(GOOD, map=number, pair=pair, provenance=known)
        for number in range(2)
        for pair in range(10)
    ]


def check(path, *words):
    return main(['transcript', 'check', str(path), *map(str, words)])


def test_a_sound_transcript_is_summarised(dataset, tmp_path, capsys):
    times = {'time': '2026-11-22T19:00:00+00:00', 'temperature': 0.5, 'seed': 3}
    path = record(tmp_path / 'a.jsonl', *whole(dataset, **times))
    with path.open('a') as file:
        file.write(json.dumps(INSTRUCTION) + '\n')
    assert check(path, '--map', dataset) == 0
    printed = capsys.readouterr().out
    assert 'model parrot, prompt few_shot: 20 exchanges of 20 samples (OK 20)' in printed
    assert '140 tokens in, 100 out, 5.0 s' in printed
    assert '  temperature 0.5\n  seed 3\n' in printed
    assert '20 of 20 samples are recorded' in printed
    assert '20 exchanges, 1 about instructions: sound' in printed


def test_every_malformed_line_is_named_with_its_number(tmp_path, capsys):
    good = GOOD.to_json()
    bad = [
        '{"map": 1',
        json.dumps({**good, 'seconds': -1}),
        json.dumps([]),
        json.dumps({**good, 'time': 'noon'}),
        json.dumps({**good, 'temperature': float('nan')}),
        json.dumps({**INSTRUCTION, 'places': 7}),
        json.dumps({**good, 'prompt_tokens': 1e300}),
    ]
    path = tmp_path / 'a.jsonl'
    path.write_text('\n'.join([json.dumps(good), *bad, json.dumps(good)]) + '\n')
    assert check(path) == 2
    printed = capsys.readouterr().out
    said = (
        'not JSON', 'seconds: -1', 'an object is expected', "time: 'noon'", 'temperature: nan',
        'places: str', 'prompt_tokens: int',
    )  # fmt: skip
    for number, words in enumerate(said, start=2):
        assert f'{path}: line {number}: {words}' in printed
    assert '2 exchanges: 7 malformed lines' in printed
    assert check(path, '--json') == 2
    assert len(json.loads(capsys.readouterr().out)['problems']) == 7


def test_missing_and_repeated_samples_are_said(dataset, tmp_path, capsys):
    exchanges = whole(dataset)[:12]
    failed = replace(exchanges[0], pair=9, map=1, response='', status=SourceStatus.TIMEOUT)
    path = record(tmp_path / 'a.jsonl', *exchanges, exchanges[3], failed)
    assert check(path, '--map', dataset) == 3
    printed = capsys.readouterr().out
    assert '12 of 20 samples are recorded, missing are 8' in printed
    assert 'of them 1 recorded without an answer (map 1: pairs 2-9)' in printed
    assert 'recorded more than once, the last answer counts: map 0: pairs 3' in printed
    assert check(path) == 0
    assert check(path, '--map', dataset, '--json') == 3
    (model,) = json.loads(capsys.readouterr().out.splitlines()[-1])['models']
    assert model['coverage']['missing'] == [{'maps': '1', 'pairs': '2-9', 'scale': 1}]
    assert model['twice'] == ['map 0: pairs 3']


def test_each_model_and_prompt_is_compared_with_the_dataset(dataset, tmp_path, capsys):
    exchanges = whole(dataset)
    others = [replace(exchange, prompt='cot') for exchange in exchanges[:5]]
    path = record(tmp_path / 'a.jsonl', *exchanges, *others)
    assert check(path, '--map', dataset) == 3
    printed = capsys.readouterr().out
    assert '20 of 20 samples are recorded\n' in printed
    assert 'prompt cot: 5 exchanges' in printed


def test_what_differs_between_the_exchanges_of_one_model_is_named(dataset, tmp_path, capsys):
    exchanges = whole(dataset, prompt_digest='aa')
    exchanges[7:9] = [
        replace(exchange, provenance=exchange.provenance._replace(prompt_digest='bb'))
        for exchange in exchanges[7:9]
    ]
    path = record(tmp_path / 'a.jsonl', *exchanges)
    assert check(path, '--map', dataset) == 3
    printed = capsys.readouterr().out
    assert 'prompt_digest differs: aa: 18 (map 0: pairs 0-6,9; map 1: pairs 0-9), bb: 2' in printed


def test_a_transcript_of_another_dataset_is_not_taken_for_this_one(dataset, tmp_path, capsys):
    path = record(tmp_path / 'a.jsonl', *whole(dataset))
    other = tmp_path / 'others.json'
    save_maps(list(generate(6, 2)), other)
    assert check(path, '--map', other) == 3
    assert f'recorded on another dataset than {other}: 20' in capsys.readouterr().out


def test_a_last_line_that_was_cut_off_is_incomplete(tmp_path, capsys):
    path = record(tmp_path / 'a.jsonl', GOOD)
    with path.open('a') as file:
        file.write('{"map": 1, "pa')
    assert check(path) == 3
    assert 'line 2: cut off while it was written' in capsys.readouterr().out


def test_an_empty_transcript_lacks_all(dataset, tmp_path, capsys):
    path = tmp_path / 'a.jsonl'
    path.write_text('')
    assert check(path) == 0
    assert check(path, '--map', dataset) == 3
    assert '0 exchanges: incomplete' in capsys.readouterr().out


def test_live_and_odd_keys_are_named_as_they_are(tmp_path, capsys):
    odd = [replace(GOOD, map='ab\x1b12', pair='1,2->3,4'), replace(GOOD, pair='last')]
    path = record(tmp_path / 'a.jsonl', *odd, *odd)
    assert check(path) == 0
    printed = capsys.readouterr().out
    assert 'map 0: last; map ab?12: 1,2->3,4' in printed
    assert '\x1b' not in printed


def test_a_file_that_cannot_be_checked_is_refused(tmp_path, capsys):
    assert check(tmp_path / 'nowhere.jsonl') == 2
    path = record(tmp_path / 'a.jsonl', *(replace(GOOD, model=f'm{n}') for n in range(101)))
    assert check(path) == 2
    assert 'over 100 models' in capsys.readouterr().err
