import math

import numpy as np
import pytest
from grids import queries
from hypothesis import given, settings
from llm_astar_planner.search.any_angle import can_see, interpolate, string_pull
from llm_astar_planner.search.astar import shortest_path
from llm_astar_planner.search.grid_graph import GridGraph


def crossed(first, last):
    """Return the cells whose inside the straight line crosses, by fine sampling."""
    steps = 64 * (abs(last[0] - first[0]) + abs(last[1] - first[1])) + 1
    shares = (np.arange(steps) + 0.5) / steps
    points = np.array(first) + np.outer(shares, np.subtract(last, first))
    inside = np.abs(points - np.rint(points)) < 0.4999
    return {tuple(cell) for cell in np.rint(points[inside.all(axis=1)]).astype(int).tolist()}


@settings(max_examples=200, deadline=None)
@given(queries(graded=False))
def test_a_line_of_sight_crosses_free_cells_only(query):
    grid, start, goal = query
    seen = can_see(grid, start, goal)
    assert seen == can_see(grid, goal, start)
    free = all(not grid.blocked[y, x] for x, y in crossed(start, goal))
    if grid.corner_cutting:
        assert seen == free
    else:
        assert not seen or free


@settings(max_examples=200, deadline=None)
@given(queries())
def test_a_pulled_path_is_free_and_never_longer(query):
    grid, start, goal = query
    path, _ = shortest_path(grid, start, goal)
    pulled = string_pull(grid, path)
    if len(path) == 0:
        assert len(pulled.points) == 0
        return
    assert tuple(pulled.points[0].tolist()) == start
    assert tuple(pulled.points[-1].tolist()) == goal
    for first, last in zip(pulled.points.tolist(), pulled.points[1:].tolist()):
        assert can_see(grid, tuple(first), tuple(last))
    steps = np.hypot(*np.diff(path, axis=0).T.astype(float)).sum()
    assert pulled.length <= steps + 1e-9
    assert pulled.cost >= pulled.length - 1e-9


def test_a_path_on_a_free_grid_becomes_one_segment():
    grid = GridGraph(np.zeros((5, 9), dtype=bool))
    path, _ = shortest_path(grid, (0, 0), (8, 3))
    pulled = string_pull(grid, path)
    assert pulled.points.tolist() == [[0, 0], [8, 3]]
    assert pulled.length == pulled.cost == math.hypot(8, 3)


def test_a_line_through_the_corner_of_an_obstacle_is_not_free():
    blocked = np.zeros((3, 3), dtype=bool)
    blocked[0, 1] = True
    # The line from (0, 0) to (1, 1) passes through a corner of the blocked cell.
    assert not can_see(GridGraph(blocked), (0, 0), (1, 1))
    assert can_see(GridGraph(blocked, corner_cutting=True), (0, 0), (1, 1))


def test_a_path_is_not_pulled_through_expensive_cells():
    cost = np.zeros((5, 9))
    cost[1:4, 3:6] = 100.0
    free = np.zeros((5, 9), dtype=bool)
    expensive = GridGraph(free, cost=cost, cost_multiplier=20.0)
    path, _ = shortest_path(expensive, (0, 2), (8, 2))
    around = string_pull(expensive, path)
    assert len(around.points) > 2
    assert around.cost < 12.0
    assert string_pull(GridGraph(free), path).points.tolist() == [[0, 2], [8, 2]]


def test_a_path_through_an_obstacle_is_refused():
    blocked = np.zeros((3, 3), dtype=bool)
    blocked[1, 1] = True
    with pytest.raises(ValueError, match='is blocked'):
        string_pull(GridGraph(blocked), np.array([[0, 0], [1, 1], [2, 2]], dtype=np.int32))
    with pytest.raises(ValueError, match='off a grid'):
        string_pull(GridGraph(blocked), np.array([[0, 0], [3, 0]], dtype=np.int32))


def test_points_between_turns_are_evenly_spaced():
    points = interpolate(np.array([[0, 0], [4, 3], [4, 4]]), spacing=1.0)
    gaps = np.hypot(*np.diff(points, axis=0).T)
    assert gaps == pytest.approx(np.ones(6))
    assert points[0].tolist() == [0.0, 0.0]
    assert points[5].tolist() == [4.0, 3.0]
    with pytest.raises(ValueError, match='spacing'):
        interpolate(points, spacing=0.0)
