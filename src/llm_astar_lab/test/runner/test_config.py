"""Runs are started and resumed so that no row is lost and rows of two runs are never mixed."""

import pytest
from benchmark_samples import FakeSource, config_of
from llm_astar_lab.results.folder import ResultsFolder, describe_run
from llm_astar_lab.results.row import ResultsError
from llm_astar_lab.runner.config import (
    choose_folder,
    open_folder,
    run_into_folder,
)
from llm_astar_lab.runner.sources import SourceSpec


def start_run(folder, config, dataset, seed=0, *, resume):
    """Start or resume a run of a dataset; return its tasks and its metadata."""
    metadata = describe_run([dataset], {'seed': seed})
    return config.tasks(open_folder(folder, metadata, resume=resume)), metadata


def test_an_interrupted_run_keeps_its_rows_and_is_resumed(dataset, tmp_path):
    config, folder = config_of(dataset), ResultsFolder(tmp_path / 'out')
    tasks, metadata = start_run(folder, config, dataset, resume=False)
    steps = []

    def interrupt():
        steps.append(1)
        if len(steps) == 5:
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        run_into_folder(folder, tasks, 1, interrupt)
    kept = list(folder.read())
    assert len(kept) == 5 * 3
    folder.write_json('metadata.json', metadata)
    with folder.results.open('a') as file:
        file.write('13,2,1,astar,none')
    left, metadata = start_run(folder, config, dataset, resume=True)
    assert len(left) == len(tasks) - 5
    run_into_folder(folder, left, 1, lambda: None)
    keys = [row.key for row in folder.read()]
    assert len(keys) == len(set(keys)) == 3 * len(tasks)


def test_resuming_asks_again_where_no_source_answered(dataset, tmp_path):
    folder = ResultsFolder(tmp_path / 'out')
    config = config_of(dataset, [SourceSpec(), SourceSpec(FakeSource(), 'broken')])
    tasks, _ = start_run(folder, config, dataset, resume=False)
    run_into_folder(folder, tasks[:3], 2, lambda: None)
    left, _ = start_run(folder, config, dataset, resume=True)
    assert [len(task.variants) for task in left[:4]] == [1, 1, 1, 3]


def test_rows_of_different_runs_are_never_mixed(dataset, tmp_path):
    folder, config = ResultsFolder(tmp_path / 'out'), config_of(dataset)
    tasks, _ = start_run(folder, config, dataset, resume=False)
    run_into_folder(folder, tasks[:1], 1, lambda: None)
    with pytest.raises(ResultsError, match='--resume'):
        start_run(folder, config, dataset, resume=False)
    with pytest.raises(ResultsError, match=r'seed \(0 before\)'):
        start_run(folder, config, dataset, 1, resume=True)
    dataset.write_text(dataset.read_text() + '\n')
    with pytest.raises(ResultsError, match='dataset'):
        start_run(folder, config, dataset, resume=True)


def test_a_run_killed_before_its_first_row_is_started_again(dataset, tmp_path):
    folder, config = ResultsFolder(tmp_path / 'out'), config_of(dataset)
    tasks, _ = start_run(folder, config, dataset, resume=False)
    folder.results.unlink()
    assert len(start_run(folder, config, dataset, resume=True)[0]) == len(tasks)


def test_scale_one_runs_all_samples_and_the_scales_share_the_drawn_ones(dataset):
    config = config_of(dataset, scales=(1, 2, 3), scale_samples=4)
    tasks = config.tasks()
    by_scale = {s: {t.sample.key for t in tasks if t.scale == s} for s in (1, 2, 3)}
    assert len(by_scale[1]) == 31
    assert by_scale[2] == by_scale[3] < by_scale[1]
    assert len(by_scale[2]) == 4
    assert len(tasks) == 31 + 4 + 4


def test_a_folder_without_rows_blocks_no_run(dataset, tmp_path):
    folder, config = ResultsFolder(tmp_path / 'out'), config_of(dataset)
    assert len(start_run(folder, config, dataset, resume=False)[0]) > 0
    assert len(start_run(folder, config, dataset, 1, resume=False)[0]) > 0


def test_every_run_gets_a_folder_of_its_own_unless_it_is_named(tmp_path):
    default = str(tmp_path / 'bench')
    for name in ('bench', 'bench-2', 'bench-3'):
        folder = choose_folder(None, default, resume=False)
        assert folder.path.name == name
        folder.start()
        folder.results.write_text(folder.results.read_text() + 'a row\n')
        assert choose_folder(None, default, resume=True).path.name == name
    assert choose_folder(default, default, resume=False).path.name == 'bench'
