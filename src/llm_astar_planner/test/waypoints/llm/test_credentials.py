"""Endpoints: which URLs and names of keys are accepted, and which hosts are loopback."""

import pytest
from llm_astar_planner.waypoints.llm.credentials import Endpoint, EndpointError


@pytest.mark.parametrize(
    'url',
    [
        'ftp://host/v1', 'host/v1', '', 'http://', 'http://user:secret@host/v1',
        'https://host/v1?api-key=secret', 'https://host/v1#secret', 'http://host:port/v1',
    ],
)  # fmt: skip
def test_a_wrong_url_or_one_with_a_secret_is_rejected_without_repeating_it(url):
    with pytest.raises(EndpointError, match='base_url: ') as error:
        Endpoint(url)
    assert 'secret' not in str(error.value)


@pytest.mark.parametrize('name', ['sk-pasted-secret', 'gsk_PastedSecret', 'with space', 'A' * 65])
def test_a_key_pasted_instead_of_its_name_is_not_repeated(name):
    with pytest.raises(EndpointError, match='api_key_env: the NAME') as error:
        Endpoint('http://localhost:1/v1', name)
    assert name not in str(error.value)


def test_loopback_hosts_are_recognised():
    hosts = ('localhost', '127.0.0.1', '127.9.9.9', '[::1]', 'LOCALHOST', 'robot.localhost')
    assert all(Endpoint(f'http://{host}:8080/v1').is_loopback for host in hosts)
    others = ('10.0.0.1', 'robot', 'localhost.example.com', '0.0.0.0', '[::2]')  # noqa: S104
    assert not any(Endpoint(f'http://{host}/v1').is_loopback for host in others)
    assert Endpoint('http://localhost:8080/v1/').url == 'http://localhost:8080/v1/chat/completions'


def test_openai_gets_its_own_key_by_default(monkeypatch):
    monkeypatch.setenv('OPENAI_API_KEY', ' secret-of-openai\n')
    assert Endpoint('https://api.openai.com/v1').key() == 'secret-of-openai'
    assert Endpoint('http://localhost:8080/v1').key() == ''
