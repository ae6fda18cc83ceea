import math

import numpy as np
import pytest
from grids import queries
from hypothesis import given, settings
from llm_astar_planner.search.any_angle import can_see, interpolate, string_pull
from llm_astar_planner.search.astar import shortest_path
from llm_astar_planner.search.grid_graph import GridGraph


def crossed(first, last):
    """The cells whose inside the straight way crosses, by sampling it finely off its crossings."""
    steps = 64 * (abs(last[0] - first[0]) + abs(last[1] - first[1])) + 1
    shares = (np.arange(steps) + 0.5) / steps
    points = np.array(first) + np.outer(shares, np.subtract(last, first))
    inside = np.abs(points - np.rint(points)) < 0.4999
    return {tuple(cell) for cell in np.rint(points[inside.all(axis=1)]).astype(int).tolist()}


@settings(max_examples=200, deadline=None)
@given(queries(graded=False))
def test_sight_crosses_free_cells_only(query):
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
def test_a_shortened_path_is_open_and_never_longer(query):
    grid, start, goal = query
    path, _ = shortest_path(grid, start, goal)
    taut = string_pull(grid, path)
    if len(path) == 0:
        assert len(taut.points) == 0
        return
    assert tuple(taut.points[0].tolist()) == start
    assert tuple(taut.points[-1].tolist()) == goal
    for first, last in zip(taut.points.tolist(), taut.points[1:].tolist()):
        assert can_see(grid, tuple(first), tuple(last))
    steps = np.hypot(*np.diff(path, axis=0).T.astype(float)).sum()
    assert taut.length <= steps + 1e-9
    assert taut.cost >= taut.length - 1e-9


def test_an_open_path_becomes_one_leg():
    grid = GridGraph(np.zeros((5, 9), dtype=bool))
    path, _ = shortest_path(grid, (0, 0), (8, 3))
    taut = string_pull(grid, path)
    assert taut.points.tolist() == [[0, 0], [8, 3]]
    assert taut.length == taut.cost == math.hypot(8, 3)


def test_corners_are_kept_clear_of():
    blocked = np.zeros((3, 3), dtype=bool)
    blocked[0, 1] = True
    # From (0, 0) to (1, 1) the way crosses the corner beside the blocked cell.
    assert not can_see(GridGraph(blocked), (0, 0), (1, 1))
    assert can_see(GridGraph(blocked, corner_cutting=True), (0, 0), (1, 1))


def test_a_shortcut_through_dear_cells_is_not_taken():
    cost = np.zeros((5, 9))
    cost[1:4, 3:6] = 100.0
    free = np.zeros((5, 9), dtype=bool)
    dear = GridGraph(free, cost=cost, cost_multiplier=20.0)
    path, _ = shortest_path(dear, (0, 2), (8, 2))
    around = string_pull(dear, path)
    assert len(around.points) > 2
    assert around.cost < 12.0
    assert string_pull(GridGraph(free), path).points.tolist() == [[0, 2], [8, 2]]


def test_a_barred_path_is_refused():
    blocked = np.zeros((3, 3), dtype=bool)
    blocked[1, 1] = True
    with pytest.raises(ValueError, match='is blocked'):
        string_pull(GridGraph(blocked), np.array([[0, 0], [1, 1], [2, 2]], dtype=np.int32))
    with pytest.raises(ValueError, match='off a grid'):
        string_pull(GridGraph(blocked), np.array([[0, 0], [3, 0]], dtype=np.int32))


def test_points_between_turns_are_evenly_apart():
    points = interpolate(np.array([[0, 0], [4, 3], [4, 4]]), spacing=1.0)
    gaps = np.hypot(*np.diff(points, axis=0).T)
    assert gaps == pytest.approx(np.ones(6))
    assert points[0].tolist() == [0.0, 0.0]
    assert points[5].tolist() == [4.0, 3.0]
    with pytest.raises(ValueError, match='spacing'):
        interpolate(points, spacing=0.0)
