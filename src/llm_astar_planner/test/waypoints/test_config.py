"""Settings are checked by name; the shipped parameter files fit them, and the docs name them."""

import math
from dataclasses import fields, replace
from pathlib import Path

import pytest
import yaml
from llm_astar_planner.waypoints.config import SettingsError, SourceSettings, make_source
from llm_astar_planner.waypoints.llm.source import client_of
from llm_astar_planner.waypoints.replay import ReplayError
from llm_astar_planner.waypoints.source import WaypointReply
from llm_astar_planner.waypoints.transcript import TranscriptError

ROOT = Path(__file__).parents[4]
KINDS = ('openai', 'ollama', 'vllm', 'llamacpp', 'replay')
TYPES = {field.name: type(field.default) for field in fields(SourceSettings)}


def parameters(kind):
    text = (ROOT / 'config' / f'llm_{kind}.yaml').read_text()
    return yaml.safe_load(text)['/**/llm_client_node']['ros__parameters']


@pytest.mark.parametrize('kind', KINDS)
def test_a_parameter_file_fits(kind):
    values = parameters(kind)
    values.pop('dataset', None)
    assert {name: type(value) for name, value in values.items()} == {
        name: TYPES[name] for name in values
    }
    settings = SourceSettings(**values)
    settings.check()
    if kind != 'replay':
        client = client_of(make_source(settings))
        assert client.endpoint.is_loopback == (kind != 'openai')


def test_the_docs_name_every_parameter_and_file():
    text = (ROOT / 'docs' / 'reference.md').read_text()
    for name, kind in TYPES.items():
        assert f'`{name}`' in text, (name, kind)
    text = (ROOT / 'docs' / 'llm-client.md').read_text()
    for kind in KINDS:
        assert f'config/llm_{kind}.yaml' in text


def test_settings_are_checked_by_name():
    good = SourceSettings(source='endpoint', base_url='http://localhost:1/v1')
    assert make_source(good).name == 'endpoint'
    assert make_source(SourceSettings(source='none')).name == 'none'
    for change, words in (
        (
            {'source': 'magic'},
            "source: 'magic' is not one of auto, none, embedded",
        ),
        ({'temperature': 3.0}, 'temperature: 3.0 is not in 0 to 2'),
        ({'timeout_s': math.nan}, 'timeout_s: nan is not'),
        ({'timeout_s': 0.0}, 'timeout_s: 0.0 is not'),
        ({'max_retries': 99}, 'max_retries: 99 is not in 0 to 10'),
        ({'max_concurrent': 0}, 'max_concurrent: 0'),
        ({'max_output_tokens': 0}, 'max_output_tokens: 0'),
        ({'max_prompt_tokens': 1}, 'max_prompt_tokens: 1'),
        ({'candidates': 0}, 'candidates: 0 is not in 1 to 64'),
        ({'max_calls_per_hour': -1}, 'max_calls_per_hour: -1'),
        ({'max_tokens_per_day': -1}, 'max_tokens_per_day: -1'),
        ({'response_format': 'xml'}, "'xml' is not one of text, json_object, json_schema"),
        ({'prompt': 'mine'}, "prompt: 'mine' is none of few_shot, zero_shot, cot, repe"),
        ({'prompt_form': 'poem'}, "'poem' is not one of message, turns, completion"),
        ({'retrieved_examples': 101}, 'retrieved_examples: 101 is not in 0 to 100'),
        (
            {'retrieved_examples': 1, 'prompt': 'cot'},
            'retrieved_examples: these hold no thoughts, which the prompt cot asks for',
        ),
        ({'base_url': 'nowhere'}, 'base_url: '),
        ({'api_key_env': 'HOME'}, 'api_key_env: the name must match'),
        ({'model': 'm' * 100_000}, 'model: .* is no name of at most 200 printable'),
        ({'model': 'gpt\udcff'}, 'model: .* is no name'),
        ({'model': 'gpt\x1b[31m'}, 'model: .* is no name'),
        ({'source': 'replay'}, 'transcript: '),
    ):
        with pytest.raises(SettingsError, match=words):
            make_source(replace(good, **change))


def test_wrong_files_are_named(tmp_path):
    replay = SourceSettings(source='replay', transcript=str(tmp_path / 'none.jsonl'))
    with pytest.raises(TranscriptError, match=r'none\.jsonl'):
        make_source(replay)
    (tmp_path / 'none.jsonl').touch()
    with pytest.raises(ReplayError, match='it holds: nothing'):
        make_source(replay)


def test_settings_hold_the_parameters_of_the_design():
    names = {field.name for field in fields(SourceSettings)}
    assert names >= {'source', 'base_url', 'model', 'prompt', 'timeout_s', 'max_retries'}
    assert names >= {'max_output_tokens', 'temperature', 'response_format', 'api_key_env'}
    assert names >= {'max_calls_per_hour', 'max_tokens_per_day'}
    assert WaypointReply().messages == ()
