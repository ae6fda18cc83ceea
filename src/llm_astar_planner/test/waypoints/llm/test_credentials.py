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
    assert Endpoint('http://localhost:8080/v1/').url('completions') == (
        'http://localhost:8080/v1/completions'
    )


def test_openai_gets_its_own_key_by_default(monkeypatch):
    monkeypatch.setenv('OPENAI_API_KEY', ' secret-of-openai\n')
    assert Endpoint('https://api.openai.com/v1').key() == 'secret-of-openai'
    assert Endpoint('http://localhost:8080/v1').key() == ''


@pytest.mark.parametrize('name', ['HOME', 'AWS_SECRET_ACCESS_KEY', 'API_KEY', 'ROBOT_API_KEY_2'])
def test_a_variable_that_is_not_on_the_list_is_never_a_key(name):
    with pytest.raises(EndpointError, match=r'must match \*_API_KEY or \*_TOKEN; .*api_key_names'):
        Endpoint('http://localhost:1/v1', name)
    assert Endpoint('http://localhost:1/v1', name, f'*_TOKEN, {name}').api_key_env == name
    assert Endpoint('http://localhost:1/v1', 'HF_TOKEN').api_key_env == 'HF_TOKEN'


@pytest.mark.parametrize('names', ['home', 'A-B', 'OK, [A-Z]*', '?_KEY', 'A' * 65])
def test_a_wrong_list_of_variables_is_rejected(names):
    with pytest.raises(EndpointError, match='api_key_names: names of variables'):
        Endpoint('http://localhost:1/v1', '', names)


def test_an_empty_list_allows_no_key():
    with pytest.raises(EndpointError, match='must match none'):
        Endpoint('http://localhost:1/v1', 'ROBOT_API_KEY', '')
