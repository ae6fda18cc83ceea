"""The exact A* against a plain Dijkstra, published lengths and small grids worked by hand."""

import csv
import math
import os
import threading
from pathlib import Path

import numpy as np
import pytest
from grids import assert_path, dijkstra, queries
from hypothesis import given, settings
from llm_astar_msgs_adapter.maps.movingai import load_map
from llm_astar_planner.search import grid_graph
from llm_astar_planner.search.astar import exact_astar, shortest_path
from llm_astar_planner.search.grid_graph import GridGraph
from llm_astar_planner.search.result import SearchStatus


@settings(max_examples=400, deadline=None)
@given(queries())
def test_it_is_exact_on_random_grids(query):
    grid, start, goal = query
    truth = dijkstra(grid, start, goal)
    result = exact_astar(grid, start, goal)
    path, cost = shortest_path(grid, start, goal)
    if math.isinf(truth):
        assert result.status is SearchStatus.EXHAUSTED
        assert len(result.path) == len(path) == 0
        assert cost == math.inf
        return
    assert result.status is SearchStatus.FOUND
    assert result.suboptimality_bound == 1.0
    # Fixed-point costs round each move down by less than a unit.
    assert result.cost == pytest.approx(truth, abs=len(result.path) / grid.straight + 1e-6)
    assert_path(grid, result.path, start, goal, result.cost)
    assert_path(grid, path, start, goal, result.cost)


@settings(max_examples=150, deadline=None)
@given(queries(graded=False))
def test_dropping_pointless_moves_changes_no_cost(query):
    grid, start, goal = query
    pruned = exact_astar(grid, start, goal)
    full = exact_astar(grid, start, goal, every_move=True)
    assert pruned.cost == full.cost
    assert pruned.status is full.status


def test_published_optimal_lengths():
    folder = os.environ.get('LLM_ASTAR_REFERENCE')
    if not folder:
        pytest.skip('LLM_ASTAR_REFERENCE is not set')
    grids: dict[str, GridGraph] = {}
    with (Path(folder) / 'grids' / 'scenarios.csv').open() as file:
        rows = list(csv.DictReader(file))
    assert len(rows) == 120
    for row in rows:
        name = row['map']
        if name not in grids:
            grids[name] = GridGraph(load_map(Path(folder) / 'grids' / f'{name}.map').blocked())
        start = int(row['start_x']), int(row['start_y'])
        goal = int(row['goal_x']), int(row['goal_y'])
        result = exact_astar(grids[name], start, goal, want_expanded=False)
        assert abs(result.length - float(row['optimal_length'])) <= 0.005
        assert_path(grids[name], result.path, start, goal, result.cost)


def test_corner_cutting_is_off_by_default():
    blocked = np.array([[False, True], [True, False]])
    assert exact_astar(blocked, (0, 0), (1, 1)).status is SearchStatus.EXHAUSTED
    cut = exact_astar(blocked, (0, 0), (1, 1), corner_cutting=True)
    assert cut.length == math.sqrt(2.0)


def test_start_as_goal_is_a_path_of_one_cell():
    result = exact_astar(np.zeros((3, 3), dtype=bool), (1, 2), (1, 2))
    assert result.status is SearchStatus.FOUND
    assert result.path.tolist() == [[1, 2]]
    assert result.length == result.cost == 0.0
    assert result.suboptimality_bound == 1.0


def test_a_blocked_start_or_goal_has_no_path():
    blocked = np.zeros((3, 3), dtype=bool)
    blocked[0, 0] = True
    grid = GridGraph(blocked)
    assert exact_astar(grid, (0, 0), (2, 2)).status is SearchStatus.EXHAUSTED
    assert shortest_path(grid, (2, 2), (0, 0))[1] == math.inf


def test_the_expanded_cells_are_those_counted():
    blocked = np.zeros((9, 9), dtype=bool)
    result = exact_astar(blocked, (0, 4), (8, 4))
    assert result.expansions == 8  # straight to the goal, which is not expanded
    assert int(result.expanded.sum()) == 8
    assert result.expanded[4, :8].all()
    assert exact_astar(blocked, (0, 4), (8, 4), want_expanded=False).expanded.size == 0


def test_the_path_avoids_an_expensive_cell():
    cost = np.zeros((3, 3))
    cost[1, 1] = 100.0
    free = np.zeros((3, 3), dtype=bool)
    grid = GridGraph(free, cost=cost, cost_multiplier=2.0)
    around = exact_astar(grid, (0, 1), (2, 1))
    assert (1, 1) not in {tuple(cell) for cell in around.path.tolist()}
    # Straight through costs twice 1 + 0.5 / 2; around costs twice the square root of 2.
    through = GridGraph(free, cost=cost, cost_multiplier=0.5)
    assert exact_astar(through, (0, 1), (2, 1)).cost == pytest.approx(2.5, rel=1e-3)


def test_cells_off_the_grid_are_refused():
    with pytest.raises(ValueError, match='off a grid of 3 x 2'):
        exact_astar(np.zeros((2, 3), dtype=bool), (0, 2), (0, 0))


def test_a_raised_stop_flag_ends_the_search():
    blocked = np.zeros((200, 200), dtype=bool)
    blocked[100, :199] = True
    blocked[:150, 150] = True
    stop = np.ones(1, dtype=np.uint8)
    result = exact_astar(blocked, (0, 0), (10, 190), stop=stop)
    assert result.status is SearchStatus.STOPPED
    assert result.expansions < 5000
    with pytest.raises(InterruptedError):
        shortest_path(GridGraph(blocked), (0, 0), (10, 190), stop=stop)


def test_many_threads_may_share_a_grid():
    random = np.random.default_rng(5)
    blocked = random.random((120, 120)) < 0.2
    blocked[[0, 119], [0, 119]] = False
    grid = GridGraph(blocked)
    expected = exact_astar(grid, (0, 0), (119, 119)).cost
    costs = []

    def work():
        costs.extend(shortest_path(grid, (0, 0), (119, 119))[1] for _ in range(20))

    threads = [threading.Thread(target=work) for _ in range(4)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert costs == [expected] * 80


def test_a_very_long_path_is_searched_in_coarse_units():
    grid = GridGraph(np.zeros((2, 400), dtype=bool))
    fine = exact_astar(grid, (0, 0), (399, 1))
    huge = GridGraph(grid.blocked)
    # Units so fine that 32 bits hold only some 200 cells of path.
    huge.straight, huge.diagonal = (value * 4000 for value in grid_graph.FINE_UNITS)
    huge.ring = 1 << 20
    result = exact_astar(huge, (0, 0), (399, 1))
    assert result.length == fine.length
    assert result.cost == pytest.approx(fine.cost, rel=1e-4)
    assert shortest_path(huge, (0, 0), (399, 1))[1] == result.cost
