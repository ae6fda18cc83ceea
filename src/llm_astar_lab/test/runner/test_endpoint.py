"""Runs of a live endpoint."""

from llm_astar_planner.cli.main import main


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
