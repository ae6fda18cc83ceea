"""A protocol pins samples, prompts and seeds; a user's file names the model."""

import json

import pytest
from llm_astar_lab.runner.protocol import PROTOCOLS, ProtocolError, read_card
from llm_astar_planner.cli.main import main

CARD = 'protocol: llm-astar-1000\nmodel: parrot-1\nquantisation: Q4_K_M\nserver: "parrots 2.1"\n'


def test_a_run_asks_in_three_ways_with_a_seed_and_says_of_whom(tmp_path, chat_server, capsys):
    chat_server.script = [chat_server.completion('Generated Path: [[25, 15]]')]
    card, out = tmp_path / 'card.yaml', tmp_path / 'out'
    card.write_text(f'{CARD}base_url: {chat_server.base_url}\n')
    words = ('bench', '--protocol', card, '--limit', '2', '--out', out, '--methods', 'astar')
    assert main([*map(str, words)]) == 0
    capsys.readouterr()
    assert {body['seed'] for body in chat_server.requests} == {0}
    assert {body['model'] for body in chat_server.requests} == {'parrot-1'}
    written = json.loads((out / 'protocol.json').read_text())
    assert (written['quantisation'], written['server']) == ('Q4_K_M', 'parrots 2.1')
    assert (written['seeds'], written['temperatures']) == ([0], [0.0])
    assert written['statuses'] == {'OK': 6}
    assert len(written['prompt_digests']) == 2  # of the files of templates
    cases = {case['case'] for case in json.loads((out / 'summary.json').read_text())['cases']}
    for prompt in ('zero_shot', 'few_shot', 'few_shot+retrieved_5'):
        assert f'llm_astar/endpoint/{prompt}/parrot-1' in cases
    report = (out / 'report.md').read_text()
    assert 'protocol llm-astar-1000' in report
    assert 'parrot-1, Q4_K_M, on parrots 2.1; 2 samples' in report


@pytest.mark.parametrize(
    ('text', 'problem'),
    [
        ('- a list\n', 'fields are expected'),
        (CARD.replace('parrot-1', ''), 'model: a text'),
        (CARD.replace('llm-astar-1000', 'mine'), f'none of {", ".join(PROTOCOLS)}'),
        (f'{CARD}prompt: cot\n', '"prompt": is none of'),
        (CARD.replace('Q4_K_M', '[4]'), 'quantisation: a text'),
        ('protocol: [', 'not yaml'),
    ],
)
def test_a_file_that_cannot_be_used_names_the_field(tmp_path, text, problem):
    path = tmp_path / 'card.yaml'
    path.write_text(text)
    with pytest.raises(ProtocolError) as error:
        read_card(str(path))
    assert str(path) in str(error.value)
    assert problem.replace('"', '') in str(error.value).replace('"', '').replace("'", '')


def test_an_endpoint_that_knows_no_seed_is_asked_without(tmp_path, chat_server, capsys):
    chat_server.script = [
        chat_server.error(400, "unknown field 'seed'"),
        chat_server.completion('Generated Path: [[25, 15]]'),
    ]
    out = tmp_path / 'out'
    words = ('--source', 'endpoint', '--model', 'm', '--base-url', chat_server.base_url)
    more = ('--sampling-seed', '7', '--limit', '1', '--methods', 'llm_astar', '--out', str(out))
    assert main(['bench', *words, *more]) == 0
    capsys.readouterr()
    assert [body.get('seed') for body in chat_server.requests] == [7, None]
