"""The comparison with Dijkstra: it finds nothing wrong, and what is wrong it finds."""

from types import SimpleNamespace

import numpy as np
from llm_astar_planner.search.astar import exact_astar
from llm_astar_planner.search.grid_graph import GridGraph

from benchmarks import exactness


def test_searches_and_changed_maps_find_the_least_cost(capsys):
    assert exactness.main(['--maps', '6', '--changes', '2']) == 0
    assert '6 maps, 2 changes, from seed 13: 0 wrong' in capsys.readouterr().out


def test_one_wrong_path_ends_with_1(monkeypatch, capsys):
    def detour(grid, start, goal):
        path = np.array([start, start, goal])
        return SimpleNamespace(path=path, suboptimality_bound=1.0)

    monkeypatch.setattr(exactness, 'exact_astar', detour)
    assert exactness.main(['--maps', '2', '--changes', '0']) == 1
    assert 'exact: illegal moves, 1.0 asked for' in capsys.readouterr().out


def test_a_path_is_wrong_that_is_illegal_or_longer_than_asked_for_or_proven():
    blocked = np.zeros((3, 4), dtype=bool)
    blocked[1, 1] = True
    judge = exactness.Judge(blocked, np.zeros(blocked.shape))
    least = judge.least((0, 0))[2, 3]

    def problem(cells, bound=1.0, proven=1.0):
        found = SimpleNamespace(path=np.array(cells), suboptimality_bound=proven)
        return judge.problem(found, bound, least)

    cheapest = exact_astar(GridGraph(blocked), (0, 0), (3, 2))
    assert problem(cheapest.path) is None
    longer = [(0, 0), (1, 0), (2, 0), (3, 0), (3, 1), (3, 2)]
    assert problem(longer, bound=1.2, proven=1.2) is None
    assert '1.1' in problem(longer, bound=1.2, proven=1.1)
    assert '1.1' in problem(longer, bound=1.1, proven=1.2)
    assert 'illegal' in problem([(0, 0), (1, 1), (2, 2), (3, 2)])
    assert 'no path' in problem(np.empty((0, 2), dtype=int))
    assert np.isinf(judge.least((0, 0))[1, 1])
