import math

import numpy as np
from grids import dijkstra, queries
from hypothesis import given, settings
from hypothesis import strategies as st
from llm_astar_planner.search.astar import exact_astar
from llm_astar_planner.search.grid_graph import GridGraph
from llm_astar_planner.search.landmarks import LandmarkManager, Landmarks


@settings(max_examples=150, deadline=None)
@given(queries())
def test_bounds_never_exceed_the_optimum(query):
    grid, start, goal = query
    landmarks = Landmarks.build(grid, count=3)
    if landmarks is None:
        assert not grid.moves.any()
        return
    bound = landmarks.lower_bound(grid, start, goal)
    truth = dijkstra(grid, start, goal)
    assert bound <= truth + 1e-6
    if math.isinf(bound):
        assert exact_astar(grid, start, goal).path.size == 0


@settings(max_examples=100, deadline=None)
@given(queries(), st.integers(0, 2**32 - 1))
def test_bounds_stay_admissible_with_new_obstacles(query, seed):
    grid, start, goal = query
    landmarks = Landmarks.build(grid, count=3)
    if landmarks is None:
        return
    more = grid.blocked | (np.random.default_rng(seed).random(grid.blocked.shape) < 0.2)
    more[[start[1], goal[1]], [start[0], goal[0]]] = False
    changed = GridGraph(more, corner_cutting=grid.corner_cutting)
    changed.cell_surcharge = grid.cell_surcharge
    assert landmarks.is_admissible_on(changed)
    assert landmarks.lower_bound(changed, start, goal) <= dijkstra(changed, start, goal) + 1e-6


def test_they_are_admissible_only_while_no_cell_is_freed_or_becomes_cheaper():
    blocked = np.zeros((6, 6), dtype=bool)
    blocked[2, 1:5] = True
    cost = np.full((6, 6), 50.0)
    landmarks = Landmarks.build(GridGraph(blocked, cost=cost))
    more, less = blocked.copy(), blocked.copy()
    more[4, 4] = True
    less[2, 2] = False
    assert landmarks.is_admissible_on(GridGraph(more, cost=cost))
    assert landmarks.is_admissible_on(GridGraph(blocked, cost=cost + 1.0))
    assert not landmarks.is_admissible_on(GridGraph(less, cost=cost))
    assert not landmarks.is_admissible_on(GridGraph(blocked, cost=cost - 1.0))
    assert not landmarks.is_admissible_on(GridGraph(blocked))
    assert not landmarks.is_admissible_on(GridGraph(blocked, cost=cost, corner_cutting=True))
    assert not landmarks.is_admissible_on(
        GridGraph(np.zeros((5, 6), dtype=bool), cost=np.zeros((5, 6)))
    )


def test_in_a_corridor_the_bound_is_exact():
    blocked = np.zeros((3, 30), dtype=bool)
    blocked[1, :29] = True
    grid = GridGraph(blocked)
    landmarks = Landmarks.build(grid)
    truth = dijkstra(grid, (0, 0), (0, 2))
    assert truth > 29.0
    assert abs(landmarks.lower_bound(grid, (0, 0), (0, 2)) - truth) < 1e-5


def test_they_prove_that_cells_are_not_connected():
    blocked = np.zeros((3, 9), dtype=bool)
    blocked[:, 4] = True
    grid = GridGraph(blocked)
    landmarks = Landmarks.build(grid)
    assert landmarks.lower_bound(grid, (0, 0), (8, 0)) == math.inf


def test_memory_is_bounded():
    grid = GridGraph(np.zeros((50, 50), dtype=bool))
    assert Landmarks.build(grid).count == 32
    few = Landmarks.build(grid, max_bytes=3 * 4 * 2500)
    assert few.count == 3
    assert few.nbytes <= 3 * 4 * 2500
    assert Landmarks.build(grid, max_bytes=100) is None
    assert Landmarks.build(GridGraph(np.ones((4, 4), dtype=bool))) is None


def test_a_raised_stop_flag_ends_the_build():
    grid = GridGraph(np.zeros((200, 200), dtype=bool))
    assert Landmarks.build(grid, stop=np.ones(1, dtype=np.uint8)) is None


def test_the_manager_builds_keeps_and_rebuilds_landmarks():
    blocked = np.zeros((20, 20), dtype=bool)
    blocked[10, 2:] = True
    manager = LandmarkManager()
    grid = GridGraph(blocked)
    assert manager.current(grid) is None
    assert manager.wait(0.0)
    manager.update(grid)
    assert manager.wait(60.0)
    first = manager.current(grid)
    assert first is not None
    assert manager.nbytes == first.nbytes
    more = blocked.copy()
    more[5, 5] = True
    blocked_more = GridGraph(more)
    manager.update(blocked_more)
    assert manager.current(blocked_more) is first
    freed = GridGraph(np.zeros((20, 20), dtype=bool))
    assert manager.current(freed) is None
    manager.update(freed)
    assert manager.wait(60.0)
    second = manager.current(freed)
    assert second is not None
    assert second is not first
    manager.close()
    assert manager.current(freed) is None
