"""The shipped parameter files fit the settings, and the docs name them all."""

from dataclasses import fields
from pathlib import Path

import pytest
import yaml
from llm_astar_planner.waypoints.config import SourceSettings
from llm_astar_planner.waypoints.factory import client_of, make_source

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
