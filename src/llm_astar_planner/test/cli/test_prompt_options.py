"""The forms of prompts and retrieved examples as options of `llm-astar bench`."""

import json

import pytest
from llm_astar_lab.datasets.generate import generate
from llm_astar_msgs_adapter.maps.problem_maps import save_maps
from llm_astar_planner.cli.main import main


def llm_astar(*words):
    """Run a command in this process and return its exit code."""
    return main([str(word) for word in words])


@pytest.fixture(scope='module')
def dataset(tmp_path_factory):
    path = tmp_path_factory.mktemp('dataset') / 'maps.json'
    save_maps(list(generate(9, 3)), path)
    return path


def test_rows_and_replays_name_how_a_model_was_asked(
    dataset, tmp_path, capsys, chat_server, monkeypatch
):
    words = ('bench', '--map', dataset, '--map-ids', '1', '--limit', '3', '--json')
    words += ('--methods', 'llm_astar')
    live = ('--source', 'endpoint', '--base-url', chat_server.base_url, '--model', 'parrot-1')
    form = ('--prompt', 'few_shot,zero_shot', '--prompt-form', 'turns')
    examples = ('--retrieved-examples', '2', '--examples-file', dataset)
    assert llm_astar(*words, *live, *form, *examples, '--out', tmp_path / 'live') == 0
    cases = {case['case'] for case in json.loads(capsys.readouterr().out)['cases']}
    prompts = ('few_shot+turns+retrieved_2', 'zero_shot+turns+retrieved_2')
    assert {f'llm_astar/endpoint/{prompt}/parrot-1' for prompt in prompts} < cases
    roles = [message['role'] for message in chat_server.requests[0]['messages']]
    assert roles == ['system', *['user', 'assistant'] * 2, 'user']
    metadata = json.loads((tmp_path / 'live' / 'metadata.json').read_text())
    assert set(metadata['files']) == {'few_shot.txt', 'zero_shot.txt', 'maps.json'}
    assert metadata['parameters']['retrieved_examples'] == 2
    transcript = tmp_path / 'live' / 'transcript.jsonl'
    replay = ('--source', 'replay', '--transcript', transcript, '--prompt', prompts[1])
    assert llm_astar(*words, *replay, '--out', tmp_path / 'again') == 0
    cases = {case['case'] for case in json.loads(capsys.readouterr().out)['cases']}
    assert f'llm_astar/replay/{prompts[1]}/parrot-1' in cases
    assert f'llm_astar/replay/{prompts[0]}/parrot-1' not in cases


@pytest.mark.parametrize(
    ('options', 'words'),
    [
        (('--prompt-form', 'poem'), "'poem' is not one of message, turns, completion"),
        (('--retrieved-examples', '101'), '101 is not in 0 to 100'),
        (('--retrieved-examples', '2', '--prompt', 'cot'), 'which the prompt cot asks for'),
        (('--retrieved-examples', '2', '--examples-file', 'no.json'), "'no.json' is not a file"),
    ],
)
def test_options_that_cannot_be_used_are_named(tmp_path, dataset, capsys, options, words):
    out = tmp_path / 'out'
    live = ('--source', 'endpoint', '--base-url', 'http://127.0.0.1:1/v1', '--model', 'm')
    assert llm_astar('bench', '--map', dataset, '--out', out, *live, *options) == 2
    error = capsys.readouterr().err
    assert words in error
    assert len(error.strip().splitlines()) == 1
    assert not (out / 'results.csv').exists()
