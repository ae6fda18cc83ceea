import math
import time
from itertools import pairwise

import numpy as np
import pytest
from grids import can_see, queries, shortest_path
from hypothesis import given, settings
from hypothesis import strategies as st
from llm_astar_planner.search import any_angle
from llm_astar_planner.search._kernels import line_of_sight as kernels
from llm_astar_planner.search.any_angle import interpolate, string_pull, turning_points
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


def line_of(first, last):
    """Return the cells whose centres the straight line between two cells passes, in order."""
    parts = max(1, math.gcd(last[0] - first[0], last[1] - first[1]))
    step = ((last[0] - first[0]) // parts, (last[1] - first[1]) // parts)
    return [(first[0] + part * step[0], first[1] + part * step[1]) for part in range(1, parts + 1)]


def plain_pull(grid, path):
    """Pull a path taut as `string_pull` does, in plain Python and with every line looked at."""

    def cost(first, last):
        rules = grid.blocked, grid.cell_surcharge, grid.corner_cutting
        return kernels.line_cost(*rules, *first, *last)

    def pull(points):
        centres = points[:1]
        for first, last in pairwise(points):
            centres = [*centres, *line_of(first, last)]
        kept, along = centres[:1], 0.0
        for before, cell in pairwise(centres):
            segment, direct = cost(before, cell), cost(kept[-1], cell)
            if direct < 0.0 or direct > along + segment + 1e-9:
                kept.append(before)
                direct = segment
            along = direct
        return [*kept, centres[-1]]

    points = [tuple(cell) for cell in path.tolist()]
    total = math.inf
    for _ in range(8):
        points = pull(pull(points)[::-1])[::-1]
        before, total = total, sum(cost(*pair) for pair in pairwise(points))
        if total > before - 1e-9:
            break
    return points


@settings(max_examples=100, deadline=None)
@given(queries(), st.sampled_from([1, 1 << 20]))
def test_a_path_is_pulled_as_in_plain_python_in_slices_too(query, size):
    grid, start, goal = query
    path, _ = shortest_path(grid, start, goal)
    if len(path) > 1:
        with pytest.MonkeyPatch.context() as patch:
            patch.setattr(any_angle, 'SLICE', size)
            pulled = string_pull(grid, path)
        assert [tuple(point) for point in pulled.points.tolist()] == plain_pull(grid, path)


def test_a_pull_ends_at_its_deadline():
    grid = GridGraph(np.zeros((5, 9), dtype=bool))
    path, _ = shortest_path(grid, (0, 0), (8, 3))
    with pytest.raises(TimeoutError, match='left out'):
        string_pull(grid, path, deadline=time.monotonic())
    assert len(string_pull(grid, path, deadline=time.monotonic() + 60.0).points) == 2


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


def test_turning_points_keep_the_shape():
    path = np.array([(0, 0), (1, 0), (2, 0), (3, 1), (4, 2), (4, 3)], dtype=np.int32)
    assert turning_points(path).tolist() == [[0, 0], [2, 0], [4, 2], [4, 3]]
    assert len(turning_points(path[:0])) == 0
