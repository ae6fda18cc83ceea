"""Large runs: Parquet parts hold what results.csv would, and memory hardly grows with the rows."""

import json
import math
import subprocess
import sys
from dataclasses import asdict, replace
from pathlib import Path

import pytest
from benchmark_samples import A_STAR, MODEL, row
from llm_astar_lab.results import folder as results
from llm_astar_lab.results.folder import ResultsFolder
from llm_astar_lab.results.row import ResultsError
from llm_astar_lab.runner.config import LARGE_RUN, is_parquet_run

LARGE_RUN_SCRIPT = Path(__file__).with_name('large_run.py')


def run_rows():
    """Return rows of 30 samples in the order in which a parallel run finishes them."""
    rows = [
        row(variant, 10.0 * index + 0.5, map_id=index // 4, pair=index % 4, path='1,1;2,é"2')
        for index in range(30)
        for variant in (A_STAR, MODEL)
    ]
    rows[7] = replace(rows[7], source_status='TIMEOUT', clearance=math.inf)
    rows[20:40] = reversed(rows[20:40])
    return rows


def write(folder, rows):
    """Append rows three at a time, as tasks finish."""
    for begin in range(0, len(rows), 3):
        folder.append(rows[begin : begin + 3])


@pytest.fixture
def small_parts(monkeypatch):
    monkeypatch.setattr(results, 'PART_ROWS', 10)


@pytest.fixture
def parquet(tmp_path, small_parts):
    folder = ResultsFolder(tmp_path / 'parquet')
    folder.start(parquet=True)
    write(folder, run_rows())
    return folder


def parts_of(folder):
    return sorted((folder.path / 'results.parquet').iterdir())


def test_parquet_parts_and_csv_hold_the_same_rows_in_the_same_order(parquet, tmp_path):
    text = ResultsFolder(tmp_path / 'csv')
    text.start()
    write(text, run_rows())
    rows = list(parquet.read())
    assert repr(rows) == repr(list(text.read()))
    assert [item.key[:3] for item in rows] == sorted(item.key[:3] for item in run_rows())
    assert len(parts_of(parquet)) == 5
    parquet.fold()
    assert repr(list(parquet.read())) == repr(rows)
    assert len(parquet.results.read_text().splitlines()) == 1


def test_a_row_counts_once_where_a_crash_left_it_in_a_part_and_in_the_text(parquet):
    before, waiting = repr(list(parquet.read())), parquet.results.read_text()
    parquet.fold()
    parquet.results.write_text(waiting + '3,0,1,cut sho')
    (parquet.path / 'results.parquet' / '.part-000009.draft.parquet').write_text('PAR1 and no end')
    assert repr(list(ResultsFolder(parquet.path).read())) == before


@pytest.mark.parametrize('is_parquet', [False, True])
def test_only_rows_without_an_answer_are_dropped_to_be_asked_again(
    tmp_path, small_parts, is_parquet
):
    folder, rows = ResultsFolder(tmp_path), run_rows()
    folder.start(parquet=is_parquet)
    write(folder, rows)
    again = ResultsFolder(tmp_path)
    done = again.keep_answered()
    assert sum(map(len, done.values())) == len(rows) - 1
    finished = [item.variant in done[item.key[:3]] for item in rows]
    assert finished == [item.answered for item in rows]
    assert (0, 0, 2) not in done
    assert all(item.answered for item in again.read())
    again.append([replace(rows[7], source_status='OK')])
    assert len(list(again.read())) == len(rows)
    assert all(item.answered for item in again.read())


def test_a_damaged_part_is_named(parquet):
    part = parts_of(parquet)[1]
    part.write_bytes(part.read_bytes()[:-20])
    with pytest.raises(ResultsError, match=r'part-000001\.parquet: '):
        list(parquet.read())


def test_a_part_with_other_columns_or_types_is_named(parquet):
    pyarrow = pytest.importorskip('pyarrow')
    files = pytest.importorskip('pyarrow.parquet')
    part = parts_of(parquet)[2]
    table = files.read_table(part)
    files.write_table(table.drop_columns('operation'), part)
    with pytest.raises(ResultsError, match=r'part-000002\.parquet: its columns are not those of'):
        list(parquet.read())
    strange = pyarrow.array(['many'] * len(table))
    index = table.schema.get_field_index('operation')
    files.write_table(table.set_column(index, 'operation', strange), part)
    with pytest.raises(
        ResultsError, match=r'part-000002.*column operation: float without missing'
    ):
        list(parquet.read())


def test_a_full_disk_loses_no_row_of_a_parquet_run(parquet):
    before = len(list(parquet.read()))

    (parquet.path / 'results.parquet' / '.part-000005.draft.parquet').symlink_to('/dev/full')
    added = [row(A_STAR, map_id=90, pair=pair) for pair in range(10)]
    with pytest.raises(ResultsError, match='No space left on device; the rows before are kept'):
        parquet.append(added)
    assert len(list(ResultsFolder(parquet.path).read())) == before + 10


def test_large_runs_are_parquet_unless_they_are_asked_to_be_text():
    assert is_parquet_run(None, LARGE_RUN)
    assert not is_parquet_run(None, LARGE_RUN - 1)
    assert not is_parquet_run('csv', LARGE_RUN)
    assert is_parquet_run('parquet')


def test_other_libraries_read_the_parts(parquet):
    files = pytest.importorskip('pyarrow.parquet')
    tables = [files.read_table(part) for part in parts_of(parquet)]
    types = [str(tables[0].schema.field(name).type) for name in ('map', 'length', 'path')]
    assert types == ['int64', 'double', 'string']
    found = [item for table in tables for item in table.to_pylist()]
    assert sorted(map(str, found)) == sorted(str(asdict(item)) for item in parquet.read())


# Write rows, resume, summarise them; print how many bytes the peak grew by beyond a small run's.
GROWTH = """
import resource, sys
from pathlib import Path
from llm_astar_lab.analysis.summary import summarise
from llm_astar_lab.results import folder as results
from llm_astar_lab.results.folder import ResultsFolder
from llm_astar_lab.results.row import Row

results.PART_ROWS = 2000

def peak(folder, samples):
    run = ResultsFolder(folder)
    pairs = samples // 50
    run.start(parquet=sys.argv[2] == 'parquet')
    for number in range(samples):
        path = ';'.join(f'{number},{step}' for step in range(40))
        run.append(
            Row(number // pairs, number % pairs, 1, method, 'none', '', '', 'NONE', 9.0, 9.0, 9.0,
                path=path) for method in ('astar', 'guided', 'llm_astar', 'exact_astar')
        )
    run.fold()
    assert list(map(len, run.keep_answered().values())) == [4] * samples
    summaries = summarise(run.stored())
    assert [item.samples for item in summaries] == [samples] * 4
    return 1024 * resource.getrusage(resource.RUSAGE_SELF).ru_maxrss

small = peak(Path(sys.argv[1]) / 'small', 1000)
print(peak(Path(sys.argv[1]) / 'large', 5000) - small)
"""


@pytest.mark.parametrize('file_format', ['csv', 'parquet'])
def test_memory_hardly_grows_with_the_rows(tmp_path, file_format):
    words = [sys.executable, '-c', GROWTH, tmp_path, file_format]
    ended = subprocess.run(words, capture_output=True, text=True, check=False)
    assert ended.returncode == 0, ended.stderr
    # 16,000 rows more, of which each takes over 1,000 bytes in memory.
    assert int(ended.stdout) < 16_000 * 400


@pytest.mark.slow
@pytest.mark.timeout(3600)
@pytest.mark.parametrize('file_format', ['csv', 'parquet'])
def test_a_million_rows_take_less_than_500_mb_from_start_to_report(tmp_path, file_format):
    words = [sys.executable, LARGE_RUN_SCRIPT, tmp_path, '50000', file_format]
    for code, rows in ((9, 525_000), (0, 1_050_000)):
        ended = subprocess.run(words, capture_output=True, text=True, check=False)
        assert ended.returncode == code, ended.stderr
        found = json.loads(ended.stdout.splitlines()[-1])
        assert abs(found['rows'] - rows) <= 21  # of one sample
        assert found['peak'] < 500e6
