"""`llm-astar report` writes the tables of a results folder, and only these, as LaTeX."""

import pytest
from benchmark_samples import rows_with
from llm_astar_lab.results.folder import ResultsFolder, describe_run
from llm_astar_planner.cli.main import main

TABLES = {'main', 'over_none', 'spread', 'waypoints', 'paths', 'paper'}


@pytest.fixture
def folder(tmp_path):
    path = tmp_path / 'run'
    found = ResultsFolder(path)
    found.start()
    found.append(rows_with(0.8))
    found.write_json('metadata.json', describe_run([path / 'results.csv'], {'seed': 0}))
    return path


def test_the_tables_are_written_and_named(folder, capsys):
    before = {path.name for path in folder.iterdir()}
    assert main(['report', str(folder), '--latex']) == 0
    files = sorted((folder / 'tables').iterdir())
    assert {path.name for path in files} == {f'{name}.tex' for name in TABLES}
    assert sorted(capsys.readouterr().out.split()) == [str(path) for path in files]
    assert {path.name for path in folder.iterdir()} == {*before, 'tables'}


def test_a_new_run_into_the_folder_removes_its_tables(folder):
    main(['report', str(folder), '--latex'])
    ResultsFolder(folder).discard_results()
    assert list((folder / 'tables').iterdir()) == []


def test_a_folder_that_cannot_be_written_to_is_named(folder, capsys):
    (folder / 'tables').write_text('a file')
    assert main(['report', str(folder), '--latex']) == 2
    err = capsys.readouterr().err
    assert f'{folder}/tables' in err
    assert err.count('\n') == 1
