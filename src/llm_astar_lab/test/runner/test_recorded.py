"""A replay is run on the samples that its transcript holds; what it lacks is named."""

import csv
import json
from collections import defaultdict
from dataclasses import replace

import pytest
from benchmark_samples import HALL
from llm_astar_lab.datasets.generate import generate
from llm_astar_lab.datasets.named import SelectionError, load_samples
from llm_astar_lab.runner.sources import SourceSpec, groups_of, keep_recorded, ranges
from llm_astar_msgs_adapter.maps.barrier_map import load_barrier_maps
from llm_astar_msgs_adapter.maps.problem_maps import save_maps
from llm_astar_planner.cli.main import main
from llm_astar_planner.waypoints.prompts.template import template_path
from llm_astar_planner.waypoints.replay import ReplaySource
from llm_astar_planner.waypoints.source import Provenance, SampleKey, SourceStatus
from llm_astar_planner.waypoints.transcript import Exchange, TranscriptWriter

TEXT = 'Generated Path: [[25, 15]]'


def record(path, keys, model='parrot', text=TEXT, status=SourceStatus.OK):
    writer = TranscriptWriter(path)
    for number, pair, *scale in keys:
        at = scale[0] if scale else 1
        writer.write(
            Exchange(number, pair, at, model, 'few_shot', (), text, 7, 5, 0.1, status).to_json()
        )
    return path


@pytest.fixture
def dataset(tmp_path):
    path = tmp_path / 'maps.json'
    save_maps(list(generate(3, 4)), path)
    return path


def bench(dataset, out, *words):
    return main(
        ['bench', '--map', str(dataset), '--out', str(out), '--source', 'replay,oracle',
         '--methods', 'llm_astar', *map(str, words)]
    )  # fmt: skip


def samples_of(out):
    """Return the samples of each variant in results.csv."""
    with (out / 'results.csv').open() as file:
        found = defaultdict(set)
        for row in csv.DictReader(file):
            name = row['source'], row['model']
            found[name].add((int(row['map']), int(row['pair'])))
    return found


def test_every_row_is_over_the_samples_that_the_transcript_holds(dataset, tmp_path, capsys):
    keys = {(0, 1), (0, 2), (3, 7)}
    transcript = record(tmp_path / 'a.jsonl', sorted(keys))
    out = tmp_path / 'out'
    assert bench(dataset, out, '--transcript', transcript) == 0
    error = capsys.readouterr().err
    assert '3 of 40 samples are recorded' in error
    assert (
        'missing are 37 (map 0: pairs 0,3-9; maps 1-2: pairs 0-9; map 3: pairs 0-6,8-9)' in error
    )
    assert set(map(frozenset, samples_of(out).values())) == {frozenset(keys)}
    summary = json.loads((out / 'summary.json').read_text())
    assert summary['replays'][0]['missing'][1] == {'maps': '1-2', 'pairs': '0-9', 'scale': 1}
    replayed = next(case for case in summary['cases'] if case['source'] == 'replay')
    assert (replayed['samples'], replayed['unanswered']) == (3, 0)
    assert '3 of 40 samples are recorded' in (out / 'report.md').read_text()


def test_each_transcript_counts_its_own_samples_and_baselines_count_those_of_any(
    dataset, tmp_path
):
    one = record(tmp_path / 'one.jsonl', [(0, 1), (0, 2)], model='small')
    two = record(tmp_path / 'two.jsonl', [(0, 2), (1, 5)], model='large')
    out = tmp_path / 'out'
    assert bench(dataset, out, '--transcript', f'{one},{two}') == 0
    found = samples_of(out)
    assert found['replay', 'small'] == {(0, 1), (0, 2)}
    assert found['replay', 'large'] == {(0, 2), (1, 5)}
    assert found['oracle', ''] == found['none', ''] == {(0, 1), (0, 2), (1, 5)}


def test_transcripts_of_the_same_model_are_told_apart_by_their_names(dataset, tmp_path, capsys):
    one = record(tmp_path / 'one.jsonl', [(0, 1)])
    two = record(tmp_path / 'two.jsonl', [(0, 2)])
    out = tmp_path / 'out'
    assert bench(dataset, out, '--transcript', one, '--transcript', two) == 0
    found = samples_of(out)
    assert (found['replay:one', 'parrot'], found['replay:two', 'parrot']) == ({(0, 1)}, {(0, 2)})
    (tmp_path / 'sub').mkdir()
    same = record(tmp_path / 'sub' / 'one.jsonl', [(0, 3)])
    assert bench(dataset, tmp_path / 'again', '--transcript', f'{one},{same}') == 2
    assert '2 would have the same rows, replay:one, parrot' in capsys.readouterr().err


def test_exchanges_of_another_dataset_and_a_changed_transcript_are_told(dataset, tmp_path, capsys):
    out, transcript = tmp_path / 'out', tmp_path / 'a.jsonl'
    exchange = Exchange(0, 1, 1, 'parrot', 'few_shot', (), TEXT, 7, 5, 0.1, SourceStatus.OK)
    foreign = replace(exchange, provenance=Provenance(dataset_digest='f' * 64))
    TranscriptWriter(transcript).write(foreign.to_json())
    assert bench(dataset, out, '--transcript', transcript) == 0
    told = '1 exchanges of the file were recorded on another dataset'
    assert told in capsys.readouterr().err
    assert told in (out / 'report.md').read_text()
    for pair in (2, 3):
        record(transcript, [(0, pair)])
        assert bench(dataset, out, '--transcript', transcript, '--resume') == 0
        notes = json.loads((out / 'metadata.json').read_text())['notes']
        assert notes.count('a.jsonl: was another file when earlier rows were made') == 1


def test_prompts_of_the_same_name_are_refused(dataset, tmp_path, capsys):
    for name in ('a', 'b'):
        (tmp_path / name).mkdir()
        (tmp_path / name / 'mine.txt').write_text(template_path('few_shot').read_text())
    prompts = ','.join(str(tmp_path / name / 'mine.txt') for name in ('a', 'b'))
    words = ('--source', 'endpoint', '--model', 'm', '--prompt', prompts)
    assert bench(dataset, tmp_path / 'out', *words) == 2
    assert '2 would have the same rows, endpoint, m, mine' in capsys.readouterr().err


def test_a_limit_is_drawn_of_the_recorded_samples(dataset, tmp_path):
    keys = [(number, 4) for number in range(4)]
    transcript = record(tmp_path / 'a.jsonl', keys)
    assert bench(dataset, tmp_path / 'out', '--transcript', transcript, '--limit', 2) == 0
    found = samples_of(tmp_path / 'out')['none', '']
    assert len(found) == 2
    assert found < set(keys)


def test_an_exchange_without_an_answer_is_missing_and_said_so(dataset, tmp_path, capsys):
    transcript = record(tmp_path / 'a.jsonl', [(0, 1)])
    record(transcript, [(0, 2), (0, 3)], text='', status=SourceStatus.TIMEOUT)
    record(transcript, [(0, 4)], text='', status=SourceStatus.MALFORMED)
    out = tmp_path / 'out'
    assert bench(dataset, out, '--transcript', transcript) == 0
    assert 'missing are 38, of them 2 recorded without an answer' in capsys.readouterr().err
    assert samples_of(out)['replay', 'parrot'] == {(0, 1), (0, 4)}


def test_a_transcript_of_another_dataset_is_refused(dataset, tmp_path, capsys):
    transcript = record(tmp_path / 'a.jsonl', [(77, 1)])
    assert bench(dataset, tmp_path / 'out', '--transcript', transcript) == 2
    error = capsys.readouterr().err
    assert '0 of 40 samples are recorded' in error
    assert '--samples all' in error


def test_a_run_on_the_recorded_samples_is_resumed_when_the_transcript_has_grown(dataset, tmp_path):
    transcript = record(tmp_path / 'a.jsonl', [(0, 1)])
    out = tmp_path / 'out'
    assert bench(dataset, out, '--transcript', transcript) == 0
    record(transcript, [(0, 2)])
    assert bench(dataset, out, '--transcript', transcript, '--resume') == 0
    assert samples_of(out)['none', ''] == {(0, 1), (0, 2)}
    assert bench(dataset, out, '--transcript', transcript, '--resume', '--samples', 'all') == 2


def test_samples_that_were_recorded_live_are_found_by_their_cells(dataset, tmp_path):
    samples = load_samples(dataset)
    problem = load_barrier_maps(dataset)[2].scale(3)
    sample = problem.samples[6]
    ends = [','.join(map(str, problem.to_cell(end))) for end in (sample.start, sample.goal)]
    transcript = record(
        tmp_path / 'a.jsonl', [(problem.to_grid().digest, f'{ends[0]}->{ends[1]}')]
    )
    specs = [SourceSpec(), SourceSpec(ReplaySource(transcript), 'replay')]
    kept = keep_recorded(samples, specs, [1, 3], 10, 0)
    assert kept.specs[0].samples == {SampleKey(2, 6, 3)}
    assert [item.key for item in kept.samples] == [(2, 6)]
    with pytest.raises(SelectionError):
        keep_recorded(samples, specs, [1, 2], 10, 0)


def test_at_larger_scales_only_what_the_run_draws_can_be_missing(dataset, tmp_path):
    samples = load_samples(dataset)
    transcript = record(tmp_path / 'a.jsonl', [sample.key for sample in samples])
    specs = [SourceSpec(ReplaySource(transcript), 'replay')]
    [coverage] = keep_recorded(samples, specs, [1, 2, 3], 4, 0).coverage
    assert len(coverage.recorded) == len(samples) == 40
    assert sorted(key.scale for key in coverage.missing) == [2] * 4 + [3] * 4


def test_a_prompt_that_is_not_recorded_is_refused(dataset, tmp_path, capsys):
    transcript = record(tmp_path / 'a.jsonl', [(0, 0)])
    words = ('--transcript', transcript, '--prompt', 'cot')
    assert bench(dataset, tmp_path / 'out', *words) == 2
    assert 'prompt cot is not recorded; it holds: model parrot' in capsys.readouterr().err


def test_without_a_replay_every_sample_is_kept(tmp_path):
    path = tmp_path / 'hall.json'
    save_maps([HALL], path)
    samples = load_samples(path)
    assert keep_recorded(samples, [SourceSpec()], [1], 10, 0) == (samples, [SourceSpec()], [])


def test_missing_samples_are_named_in_ranges():
    assert ranges([0, 1, 2, 5, 7, 8]) == '0-2,5,7-8'
    keys = [SampleKey(*key) for key in ((1, 0), (2, 0), (4, 0), (4, 1), (1, 0, 5))]
    assert [str(group) for group in groups_of(keys)] == [
        'maps 1-2: pairs 0', 'map 4: pairs 0-1', 'map 1: pairs 0 at scale 5',
    ]  # fmt: skip
