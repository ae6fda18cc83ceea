"""The figures of README.md and docs/ are recorded with their source, and pages quote the same."""

import json

import pytest

from benchmarks import figures


def test_every_figure_is_recorded_and_pages_quote_each_other_rightly(capsys):
    assert figures.main([]) == 0, capsys.readouterr().out


def test_every_source_has_its_command_commit_and_machine():
    sources = json.loads(figures.LEDGER.read_text())['sources']
    for name, source in sources.items():
        assert source['command']
        assert name == 'settings' or (source['commit'] and source['machine'])


@pytest.mark.parametrize(
    ('page', 'figure', 'other'),
    [('README.md', '12.97', '12.4'), ('docs/results.md', '| 1.34 |', '| 1.13 |'),
     ('docs/examples.md', '598,678', '598,586')],
)  # fmt: skip
def test_a_changed_figure_fails(page, figure, other, tmp_path, monkeypatch, capsys):
    for name in figures.PAGES:
        (tmp_path / name).parent.mkdir(exist_ok=True)
        text = (figures.ROOT / name).read_text()
        (tmp_path / name).write_text(text.replace(figure, other) if name == page else text)
    monkeypatch.setattr(figures, 'ROOT', tmp_path)
    assert figures.main([]) == 1
    out = capsys.readouterr().out
    assert f'{other.strip("| ")} is not recorded' in out
    assert f'{figure.strip("| ")} is not there' in out
