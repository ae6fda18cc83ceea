import json

import numpy as np
import pytest

from benchmarks import speed
from benchmarks.speed import OURS, Problem, SpeedCase


def corner():
    blocked = np.zeros((4, 4), dtype=bool)
    blocked[1, 0] = True
    return SpeedCase('corner', (Problem(blocked, (((0, 0), (1, 2)), ((3, 3), (3, 0)))),))


def prepare_cutter(blocked):
    del blocked
    known = {(0, 0): [[0, 0], [1, 1], [1, 2]], (3, 3): [[3, 3], [3, 2], [3, 1], [3, 0]]}
    return lambda start, _: np.array(known[start])


def prepare_lost(blocked):
    del blocked
    return lambda *_: np.empty((0, 2), dtype=np.int64)


def test_a_peers_paths_are_checked_as_well_as_timed():
    planners = {OURS: speed.prepare_ours, 'cutter': prepare_cutter, 'lost': prepare_lost}
    rows = speed.measure([corner()], planners=planners, rounds=2)
    ours, cutter, lost = rows
    assert (ours.ratio, ours.solved, ours.legal, ours.optimal) == (1.0, 1.0, 1.0, 1.0)
    assert cutter.legal == 0.5
    assert cutter.optimal == 0.5
    assert cutter.excess < 0.0
    assert (lost.solved, lost.legal, lost.optimal) == (0.0, 0.0, 0.0)
    text = speed.table(rows)
    assert [line.split()[1] for line in text.splitlines()] == ['planner', OURS, 'cutter', 'lost']


def test_installed_peers_include_ours():
    assert OURS in speed.installed_planners()


def test_synthetic_queries_have_paths():
    case = speed.synthetic_case(120, queries=2)
    (problem,) = case.problems
    assert len(problem.queries) == 2
    _, paths = speed.solve(case, [speed.prepare_ours(problem.blocked)])
    assert all(len(path) > 15 for path in paths)


def test_json_prints_the_rows(capsys, monkeypatch):
    monkeypatch.setattr(speed, 'installed_planners', lambda: {OURS: speed.prepare_ours})
    assert speed.main(['--size', '60', '--rounds', '1', '--json']) == 0
    (row,) = json.loads(capsys.readouterr().out)
    assert row['planner'] == OURS
    assert row['optimal'] == 1.0


def test_slow_planners_skip_large_cases():
    planners = {OURS: speed.prepare_ours, speed.PAPER: prepare_cutter}
    assert [row.planner for row in speed.measure([corner()], planners=planners, rounds=1)] == [
        OURS
    ]
    slow = corner()._replace(slow=True)
    assert len(speed.measure([slow], planners=planners, rounds=1)) == 2


def test_runs_along_rows_cover_the_blocked_cells():
    blocked = np.random.default_rng(1).random((6, 9)) < 0.4
    covered = np.zeros_like(blocked)
    for row, first, last in speed.runs_along_rows(blocked):
        covered[row, first : last + 1] = True
    assert (covered == blocked).all()


@pytest.mark.parametrize('option', [['--size', '20'], ['--rounds', '0']])
def test_an_option_out_of_range_is_refused(option, capsys):
    with pytest.raises(SystemExit):
        speed.main(option)
    assert ' '.join(option) in capsys.readouterr().err
