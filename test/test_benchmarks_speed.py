import json

import numpy as np
import pytest

from benchmarks import (
    any_waypoints,
    cases,
    live_maps,
    map_families,
    memory,
    speed,
    speed_picture,
    tables,
)
from benchmarks.cases import Problem, SpeedCase
from benchmarks.ours import EXACT
from benchmarks.peers import PEERS, Peer


def corner():
    blocked = np.zeros((4, 4), dtype=bool)
    blocked[1, 0] = True
    queries = (((0, 0), (1, 2)), ((3, 3), (3, 0)))
    return SpeedCase('corner', (Problem(blocked, queries, (3.0, 3.5)),))


def prepare_cutter(problem):
    del problem
    known = {(0, 0): [[0, 0], [1, 1], [1, 2]], (3, 3): [[3, 3], [3, 2], [3, 1], [3, 0]]}
    return lambda start, _: np.array(known[start])


def prepare_lost(problem):
    del problem
    return lambda *_: np.empty((0, 2), dtype=np.int64)


def peer(name, prepare=prepare_lost, **changes):
    return Peer(name, 'math', prepare, 100, graded=False)._replace(**changes)


def test_a_peers_paths_are_checked_as_well_as_timed():
    peers = [peer('cutter', prepare_cutter), peer('lost')]
    rows = {row.planner: row for row in speed.measure(corner(), peers=peers, rounds=2)}
    ours, guided, cutter, lost = (rows[name] for name in (EXACT, 'guided', 'cutter', 'lost'))
    assert (ours.ratio, ours.solved, ours.legal, ours.optimal) == (1.0, 1.0, 1.0, 1.0)
    assert (guided.legal, guided.optimal, guided.published) == (1.0, 1.0, 1)
    assert (cutter.legal, cutter.optimal) == (0.5, 0.5)
    assert cutter.excess < 0.0
    assert (lost.solved, lost.legal, lost.optimal) == (0.0, 0.0, 0.0)


def test_a_peer_is_skipped_with_the_reason():
    case = corner()
    assert peer('here').reason_to_skip(case) is None
    assert 'not installed' in peer('gone', module='no_such_module').reason_to_skip(case)
    assert 'too large' in peer('small', most_cells=15).reason_to_skip(case)
    graded = cases.graded_case(corner)
    assert 'graded' in peer('uniform').reason_to_skip(graded)
    assert peer('any', graded=True).reason_to_skip(graded) is None


@pytest.mark.parametrize('known', PEERS, ids=lambda known: known.name)
def test_an_installed_peer_finds_paths(known):
    case = cases.generated_case('boxes', 100, 2)
    if known.reason_to_skip(case):
        pytest.skip(known.reason_to_skip(case))
    rows = {row.planner: row for row in speed.measure(case, peers=[known], rounds=1)}
    assert rows[known.name].solved == 1.0


@pytest.mark.parametrize('family', map_families.FAMILIES)
def test_every_family_has_queries_with_paths_and_repeats(family):
    case, again = (cases.generated_case(family, 96, 2) for _ in range(2))
    (problem,), (same,) = case.problems, again.problems
    assert problem.queries == same.queries
    assert np.array_equal(problem.blocked, same.blocked)
    assert 0.02 < problem.blocked.mean() < 0.8
    rows = speed.measure(case, peers=(), rounds=1)
    assert all(row.solved == row.legal == 1.0 for row in rows)


def test_a_saved_case_is_the_same(tmp_path):
    path = tmp_path / 'corner.npz'
    corner().save(path)
    (problem,), (same,) = corner().problems, SpeedCase.load(path).problems
    assert (problem.queries, problem.published) == (same.queries, same.published)
    assert np.array_equal(problem.blocked, same.blocked)


def test_what_was_measured_is_kept_and_printed_as_tables(tmp_path, monkeypatch, capsys):
    monkeypatch.setattr(cases, 'GENERATED', [('boxes', 120, 2)])
    monkeypatch.setattr(speed, 'PEERS', ())
    monkeypatch.setattr(any_waypoints, 'TURNS', 1)
    monkeypatch.setattr(tables, 'WORTH_MS', 0.0)
    arguments = ['--out', str(tmp_path), '--rounds', '1', '--parts', 'search', 'waypoints']
    assert speed.main(arguments) == 0
    first = capsys.readouterr()
    assert 'search boxes 120' in first.err
    assert [line.split()[0] for line in first.out.splitlines()[3:5]] == [EXACT, 'guided']
    assert 'zigzag' in first.out
    assert speed.main([*arguments, '--markdown']) == 0
    again = capsys.readouterr()
    assert again.err == ''
    assert f'|{EXACT}|1|' in again.out
    assert '|boxes 120|1±0|' in again.out
    rows = json.loads((tmp_path / 'search boxes 120.json').read_text())['rows']
    assert all(row['optimal'] == 1.0 for row in rows if row['planner'] in (EXACT, 'guided'))
    uniform, _ = speed_picture.draw(tmp_path).axes
    drawn = {line.get_label(): len(line.get_xdata()) for line in uniform.lines}
    assert (drawn[EXACT], drawn['nano-astar']) == (1, 0)


def test_memory_is_measured_in_a_process_of_its_own(tmp_path, monkeypatch):
    path = tmp_path / 'boxes.npz'
    cases.generated_case('boxes', 600, 1).save(path)
    monkeypatch.setattr(memory, 'PEERS', ())
    found = memory.measure(SpeedCase.load(path), path)
    assert set(found) == {EXACT, memory.PLANNER}
    assert found[memory.PLANNER]['held'] > 1.0


def test_live_maps_are_taken_both_ways():
    ways = live_maps.measure(150, maps=live_maps.FIRST_MAPS + 2, period=0.0)
    assert set(ways) == {live_maps.INCREMENTS, live_maps.NOTHING}
    assert all(one['plan_ms'] > 0.0 for one in ways.values())


def test_an_option_out_of_range_is_refused(capsys):
    with pytest.raises(SystemExit):
        speed.main(['--rounds', '0'])
    assert '--rounds 0' in capsys.readouterr().err
