"""`llm-astar compare` finds what became worse between two runs, and nothing between equal ones."""

import csv
import json
import math
import re
import statistics
import subprocess
import sys
from dataclasses import replace

import numpy as np
import pytest
from benchmark_samples import A_STAR, NONE, ORACLE, row
from llm_astar_lab.results.folder import ResultsFolder, describe_run
from llm_astar_lab.results.row import Variant
from llm_astar_planner.cli.main import main

ALONE = Variant('waypoints_only', 'oracle')
VARIANTS = (A_STAR, NONE, ORACLE)


def base_rows(maps=20):
    """Return rows of 10 samples a map, with work and times of a benchmark's sizes."""
    random = np.random.default_rng(3)
    rows = []
    for number in range(maps * 10):
        for variant in VARIANTS:
            work = float(random.integers(50, 3000))
            where = {'map_id': number // 10, 'pair': number % 10}
            seconds = work * 1e-6 * random.lognormal(0.0, 0.3)
            length = float(random.uniform(5.0, 60.0))
            rows.append(row(variant, work, length, **where, seconds_search=seconds))
    return rows


def write_run(path, rows, dataset=b'the maps', **metadata):
    """Write a results folder of rows; return its path."""
    folder = ResultsFolder(path)
    folder.start()
    folder.append(rows)
    file = path / 'maps.json'
    file.write_bytes(dataset)
    folder.write_json('metadata.json', {**describe_run([file], {'seed': 0}), **metadata})
    return path


def changed(rows, variant, change):
    """Return rows with those of a variant changed."""
    return [change(found) if found.variant == variant else found for found in rows]


def more_work(factor):
    return lambda found: replace(found, operation=float(round(found.operation * factor)))


@pytest.fixture(scope='module')
def rows():
    return base_rows()


@pytest.fixture(scope='module')
def base(rows, tmp_path_factory):
    return write_run(tmp_path_factory.mktemp('base'), rows)


def compare(capsys, *words):
    """Run the command; return its exit code and what it printed, stdout and stderr."""
    code = main(['compare', *(str(word) for word in words)])
    return code, *capsys.readouterr()


def test_a_planted_2_percent_regression_is_found_and_named(base, rows, tmp_path, capsys):
    other = write_run(tmp_path / 'b', changed(rows, ORACLE, more_work(1.02)))
    code, out, _ = compare(capsys, base, other)
    assert code == 1
    assert re.findall(rf'{other}: (\S+): operation is 10[12]\.\d\d %', out) == ['llm_astar/oracle']
    assert out.endswith(f'1 regression against {base}.\n')
    assert compare(capsys, base, other, '--threshold', '3')[0] == 0
    assert compare(capsys, base, other, '--metric', 'length')[0] == 0
    assert compare(capsys, base, other, '--variant', 'llm_astar/none')[0] == 0
    assert compare(capsys, other, base)[0] == 0


def test_a_regression_of_2_percent_in_1000_samples_is_found_in_noise(tmp_path, capsys):
    """Every sample changes at random by about 20 %, as with the replies of a model."""
    random = np.random.default_rng(5)
    rows = [found for found in base_rows(maps=100) if found.variant == ORACLE]
    base = write_run(tmp_path / 'base', rows)
    for name, factor, code in (('equal', 1.0, 0), ('worse', 1.02, 1)):
        found = [more_work(factor * random.lognormal(0.0, 0.2))(row) for row in rows]
        assert compare(capsys, base, write_run(tmp_path / name, found))[0] == code


def test_equal_runs_and_runs_that_differ_in_wall_time_alone_have_no_regression(
    base, rows, tmp_path, capsys
):
    assert compare(capsys, base, base)[0] == 0
    random = np.random.default_rng(7)
    slower = [
        replace(found, seconds_search=found.seconds_search * 1.3 * random.lognormal(0.0, 0.5))
        for found in rows
    ]
    other = write_run(tmp_path / 'b', slower)
    code, out, _ = compare(capsys, base, other)
    assert (code, 'Samples that changed' in out) == (0, False)
    assert compare(capsys, base, other, '--metric', 'seconds_search')[0] == 0
    code, out, _ = compare(capsys, base, other, '--metric', 'seconds_search', '--threshold', '5')
    assert (code, '3 regressions' in out) == (1, True)


def test_the_ratios_are_those_of_a_recomputation(base, rows, tmp_path, capsys):
    random = np.random.default_rng(11)
    found = [more_work(random.uniform(0.5, 2.0))(row) for row in rows]
    found = found[: len(found) - 30]  # without the last map
    other = write_run(tmp_path / 'b', found)
    code, out, _ = compare(capsys, base, other, '--json', '--variant', 'llm_astar/none')
    result = json.loads(out)
    (run,) = result['comparisons']
    (variant,) = run['variants']
    before = {row.key[:2]: row.operation for row in rows if row.variant == NONE}
    ratios = [row.operation / before[row.key[:2]] for row in found if row.variant == NONE]
    operation = variant['metrics']['operation']
    assert operation['mean']['value'] == pytest.approx(statistics.geometric_mean(ratios))
    assert operation['mean']['low'] < operation['mean']['value'] < operation['mean']['high']
    assert operation['less'] == sum(ratio < 1 for ratio in ratios)
    assert operation['more'] == sum(ratio > 1 for ratio in ratios)
    assert (variant['samples'], variant['maps'], variant['only_first']) == (190, 19, 10)
    largest = max(abs(math.log(ratio)) for ratio in ratios)
    first, second = run['samples'][0]['operation']
    assert abs(math.log(second / first)) == pytest.approx(largest)
    assert code == (operation['mean']['low'] > 1.0)
    assert bool(result['regressions']) == bool(code)


def test_lost_paths_are_a_regression_and_come_first_among_the_changes(
    base, rows, tmp_path, capsys
):
    def lost(found):
        gone = {'code': 'NO_VALID_PATH', 'operation': math.nan, 'length': math.nan}
        return replace(found, **gone) if found.pair == 4 else found

    other = write_run(tmp_path / 'b', changed(rows, ORACLE, lost))
    code, out, _ = compare(capsys, base, other, '--threshold', '50')
    assert code == 1
    assert 'llm_astar/oracle: valid paths changed by -10.00 points' in out
    assert out.count('NO_VALID_PATH') == 10
    # Found again, they are none.
    assert compare(capsys, other, base)[0] == 0


def test_a_variant_without_expansions_is_compared_by_its_length(tmp_path, capsys):
    def alone(length):
        return [
            row(ALONE, math.nan, length, map_id=map_id, pair=pair)
            for map_id in range(5)
            for pair in range(3)
        ]

    runs = [write_run(tmp_path / name, alone(length)) for name, length in (('a', 10), ('b', 11))]
    assert compare(capsys, *runs)[0] == 0
    assert compare(capsys, *runs, '--metric', 'length')[0] == 1


def test_on_a_single_map_the_interval_is_over_its_samples(tmp_path, capsys):
    rows = base_rows(maps=1)
    base = write_run(tmp_path / 'a', rows)
    other = write_run(tmp_path / 'b', changed(rows, NONE, more_work(1.1)))
    code, out, _ = compare(capsys, base, other)
    assert code == 1
    assert 'All samples are of one map' in out


def test_three_runs_are_compared_with_the_first_and_everything_is_written(
    base, rows, tmp_path, capsys
):
    second = write_run(tmp_path / 'b', changed(rows, ORACLE, more_work(0.9)))
    machine = {'processor': 'another', 'cores': 1}
    third = write_run(
        tmp_path / 'c', changed(rows, NONE, more_work(1.1)), version='9.9', machine=machine
    )
    out = tmp_path / 'out'
    code, text, _ = compare(capsys, base, second, third, '--out', out)
    assert code == 1
    assert f'{third}: llm_astar/none: operation is 110.0' in text
    assert re.search(r'version: \S+, now 9.9', text)
    assert 'machine: cores: ' in text
    page = (out / 'comparison.md').read_text()
    assert '# Comparison of runs' in page
    assert '1 regression against' in page
    result = json.loads((out / 'comparison.json').read_text())
    assert [run['folder'] for run in result['comparisons']] == [str(second), str(third)]
    with (out / 'changes_2.csv').open() as file:
        changes = list(csv.DictReader(file))
    assert len(changes) == 200
    assert {change['Variant'] for change in changes} == {'LLM-A*, no waypoints'}


def test_what_only_one_run_has_is_listed(base, rows, tmp_path, capsys):
    some = [found for found in rows if found.variant != ORACLE and found.pair != 3]
    more = [replace(found, method='guided') for found in some if found.variant == NONE]
    other = write_run(tmp_path / 'b', [*some, *more])
    code, out, _ = compare(capsys, base, other)
    assert code == 3
    assert 'not compared, because only one run has them: llm_astar/oracle, guided/none' in out
    assert f'{other}: llm_astar/oracle: is missing' in out
    assert out.endswith('1 variant cannot be judged.\n')
    assert 'guided/none: is missing' not in out
    assert '20 samples of a variant left out: only the base has them' in out


def test_one_sample_is_too_few_to_be_judged(base, rows, tmp_path, capsys):
    one = [found for found in rows if (found.map, found.pair) == (0, 0)]
    worse = [replace(found, operation=100 * found.operation) for found in one]
    runs = [write_run(tmp_path / name, some) for name, some in (('a', one), ('b', worse))]
    code, out, _ = compare(capsys, *runs)
    assert code == 3
    assert 'too few samples have operation in both runs' in out
    assert 'No variant that can be judged is worse' in out


def test_runs_of_different_datasets_are_refused(base, rows, tmp_path, capsys):
    other = write_run(tmp_path / 'b', rows[:30], dataset=b'other maps')
    code, out, err = compare(capsys, base, other)
    assert (code, out) == (2, '')
    assert err.count('\n') == 1
    assert re.search(r'cannot be compared: the first is of maps.json \(sha256 \w{12}\), the', err)


def test_runs_without_a_common_sample_are_refused(base, rows, tmp_path, capsys):
    elsewhere = [replace(found, map=found.map + 1000) for found in rows[:30]]
    code, out, err = compare(capsys, base, write_run(tmp_path / 'b', elsewhere))
    assert (code, out, err.count('\n')) == (2, '', 1)
    assert 'share no sample of any variant' in err


def test_what_a_file_says_neither_reaches_the_terminal_raw_nor_fills_it(
    base, rows, tmp_path, capsys
):
    """The codes of a results file are any texts, and one is a million characters long."""
    odd = [
        replace(found, code=f'\x1b[2J{found.pair}' + 'x' * 10**6 * (found.key == rows[0].key))
        for found in rows
    ]
    other = write_run(tmp_path / 'b', odd, machine={'processor': '\x1b]0;' + 'y' * 1000})
    code, out, _ = compare(capsys, base, other, '--out', tmp_path / 'out')
    assert code == 1
    assert '\x1b' not in out
    assert len(out) < 20_000
    assert '\x1b' not in (tmp_path / 'out' / 'comparison.md').read_text()


@pytest.mark.parametrize(
    ('name', 'value'), [('files', ['a']), ('packages', 'numpy'), ('parameters', [1])]
)
def test_metadata_of_another_shape_is_named(name, value, base, rows, tmp_path, capsys):
    other = write_run(tmp_path / 'b', rows[:3], **{name: value})
    code, out, err = compare(capsys, base, other)
    assert (code, out, err.count('\n')) == (2, '', 1)
    assert f'{other}/metadata.json: {name}: ' in err


@pytest.mark.parametrize(
    ('words', 'message'),
    [
        (['--variant', 'llm_astr'], 'no such variant; did you mean llm_astar'),
        (['--threshold', '-1'], 'is not a number of at least 0'),
        (['--threshold', 'nan'], 'is not a number of at least 0'),
        (['--metric', 'speed'], 'invalid choice'),
    ],
)
def test_a_wrong_option_is_one_line(base, words, message, capsys):
    code, out, err = compare(capsys, base, base, *words)
    assert (code, out, err.count('\n')) == (2, '', 1)
    assert message in err


def test_a_folder_that_holds_no_run_is_named(base, rows, tmp_path, capsys):
    for make in (
        lambda path: None,
        lambda path: path.mkdir(),
        lambda path: write_run(path, []),
        lambda path: (write_run(path, rows[:3]) / 'results.csv').write_text('a,b\n1,2\n'),
        lambda path: (write_run(path, rows[:3]) / 'metadata.json').write_text('[]'),
    ):
        path = tmp_path / f'run{len(list(tmp_path.iterdir()))}'
        make(path)
        code, out, err = compare(capsys, base, path)
        assert (code, out, err.count('\n')) == (2, '', 1)
        assert str(path) in err


def test_the_command_ends_with_its_exit_code(base, rows, tmp_path):
    other = write_run(tmp_path / 'b', changed(rows, A_STAR, more_work(1.02)))
    command = [sys.executable, '-m', 'llm_astar_planner.cli', 'compare', base, other]
    done = subprocess.run(command, capture_output=True, text=True, timeout=60)
    assert (done.returncode, done.stderr) == (1, '')
    assert 'astar/none: operation is 102.0' in done.stdout
