"""The results folder: damaged rows, a full disk, paths by their turning points."""

import subprocess
import sys
from dataclasses import replace

import pytest
from benchmark_samples import tasks_of, untimed
from llm_astar_lab.datasets.named import load_samples
from llm_astar_lab.results.folder import ResultsFolder, describe_run
from llm_astar_lab.results.row import ResultsError
from llm_astar_lab.runner.config import open_folder
from llm_astar_lab.runner.engine import run_task


def test_a_damaged_row_is_named_and_the_last_of_equal_keys_counts(dataset, tmp_path):
    folder = ResultsFolder(tmp_path / 'out')
    first, *_ = run_task(tasks_of(load_samples(dataset)[:1])[0])
    again = replace(first, path='1,1;' * 50_000)  # longer than csv takes by itself
    folder.start()
    folder.append([first, again])
    assert [row.path for row in folder.read()] == [again.path]
    good = folder.results.read_text()
    for damaged in ('3,0,1,astar,none,,,NONE,1.0\n', good.splitlines()[1] + ',one more\n'):
        folder.results.write_text(good + damaged)
        with pytest.raises(ResultsError, match=r'results\.csv: line 4: \d+ values are expected'):
            folder.read()


def test_inputs_of_the_same_name_keep_their_digests_apart(tmp_path):
    for name in ('a', 'b'):
        (tmp_path / name).mkdir()
        (tmp_path / name / 'r.jsonl').write_text(name)
    paths = [tmp_path / 'a' / 'r.jsonl', tmp_path / 'b' / 'r.jsonl']
    files = describe_run([], {}, paths)['files']
    assert list(files) == list(map(str, paths))
    assert len(set(files.values())) == 2
    assert list(describe_run([], {}, [paths[0], paths[0]])['files']) == ['r.jsonl']


def test_files_that_are_of_no_run_are_never_replaced(tmp_path):
    folder = ResultsFolder(tmp_path / 'paper')
    (tmp_path / 'paper' / 'tables').mkdir(parents=True)
    mine = [tmp_path / 'paper' / name for name in ('report.md', 'tables/my.tex', 'tables/x.y')]
    for path in mine:
        path.write_text('mine')
    with pytest.raises(ResultsError, match=r'report.md: is there, but of no run; name another'):
        open_folder(folder, {}, resume=False, overwrite=True)
    assert [path.read_text() for path in mine] == ['mine'] * 3


def test_only_one_process_writes_to_a_folder(tmp_path):
    ResultsFolder(tmp_path / 'out').claim()
    ResultsFolder(tmp_path / 'out').claim()  # the same process may run again
    claim = 'import sys; from llm_astar_lab.results.folder import ResultsFolder as R; '
    claim += 'R(sys.argv[1]).claim()'
    other = [sys.executable, '-c', claim]
    refused = subprocess.run([*other, tmp_path / 'out'], capture_output=True, text=True)
    assert 'another run writes to it; wait for it, or name another --out' in refused.stderr
    assert subprocess.run([*other, tmp_path / 'free']).returncode == 0


@pytest.mark.parametrize(
    ('part', 'field', 'value', 'words'),
    [
        ('parameters', 'weight', 'a', 'weight: int or float is expected'),
        ('parameters', 'seed', -1, 'seed: 0 or more'),
        (None, 'bags', [1], 'bags: str is expected'),
    ],
)
def test_metadata_with_odd_values_is_refused(tmp_path, part, field, value, words):
    folder = ResultsFolder(tmp_path)
    metadata = describe_run([], {'seed': 0})
    (metadata[part] if part else metadata)[field] = value
    folder.write_json('metadata.json', metadata)
    with pytest.raises(ResultsError, match=rf'metadata.json: .*{words}'):
        folder.read_metadata()


def test_a_full_disk_is_reported_and_earlier_rows_stay(dataset, tmp_path):
    folder = ResultsFolder(tmp_path / 'out')
    rows = run_task(tasks_of(load_samples(dataset)[:1])[0])
    folder.start()
    folder.append(rows)
    kept = folder.results.read_bytes()
    full = ResultsFolder(tmp_path / 'full')
    full.path.mkdir()
    full.results.symlink_to('/dev/full')
    with pytest.raises(ResultsError, match='No space left on device; the rows before are kept'):
        full.append(rows)
    assert folder.results.read_bytes() == kept
    assert [untimed(row) for row in folder.read()] == [untimed(row) for row in rows]
