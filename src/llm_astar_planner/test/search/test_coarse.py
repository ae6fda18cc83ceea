"""Routes over tiles: free and connected turns, doors of one cell, costs, nearly the shortest."""

from itertools import pairwise

import numpy as np
import pytest
from grids import assert_path, can_see, queries
from hypothesis import given
from hypothesis import strategies as st
from llm_astar_planner.search._kernels import coarse as kernels
from llm_astar_planner.search.astar import exact_astar
from llm_astar_planner.search.coarse import CoarseGraph
from llm_astar_planner.search.grid_graph import GridGraph
from llm_astar_planner.search.guided import guided
from llm_astar_planner.search.tiles import Tiles


def coarse(grid, shift=None):
    return CoarseGraph(Tiles.build(grid.blocked, shift, corner_cutting=grid.corner_cutting), grid)


def octile(begin, end):
    longer, shorter = sorted(abs(np.subtract(begin, end)), reverse=True)
    return longer + (2**0.5 - 1) * shorter


def rectangles(seed, side, count=40):
    """A grid strewn with rectangles, and two free cells of its largest component."""
    random = np.random.default_rng(seed)
    blocked = np.zeros((side, side), dtype=bool)
    for _ in range(count):
        top, left = random.integers(0, side, 2)
        height, width = random.integers(1, side // 5, 2)
        blocked[top : top + height, left : left + width] = True
    numbers = Tiles.build(blocked)[:, :]
    ys, xs = np.nonzero(numbers == np.bincount(numbers[numbers > 0]).argmax())
    return blocked, [(int(xs[i]), int(ys[i])) for i in random.integers(0, len(xs), 2)]


@given(query=queries(), shift=st.sampled_from([1, 2, 3, 4]))
def test_turns_are_free_and_connected_and_a_search_led_by_them_is_valid(query, shift):
    grid, start, goal = query
    found = exact_astar(grid, start, goal)
    tiles = Tiles.build(grid.blocked, shift, corner_cutting=grid.corner_cutting)
    turns = CoarseGraph(tiles, grid).turns(start, goal)
    if not len(found.path):
        assert turns is None
        return
    assert all(tiles[int(y), int(x)] == tiles[start[1], start[0]] for x, y in turns)
    if start == goal:
        assert len(turns) == 0
    led = guided(grid, start, goal, turns)
    assert_path(grid, led.path, start, goal, led.cost)


@pytest.mark.parametrize('side', [40, 300])
@pytest.mark.parametrize('axis', [0, 1])
def test_a_door_of_one_cell_is_found_wherever_it_is(side, axis):
    for offset in range(9):
        wall = side // 2 + offset
        for door in range(side // 3, side // 3 + 9):
            blocked = np.zeros((side, side), dtype=bool)
            blocked[:, wall] = True
            blocked[door, wall] = False
            blocked = blocked.T.copy() if axis else blocked
            grid = GridGraph(blocked)
            start, goal = ((2, side - 3), (side - 3, side - 3))
            start, goal = (start[::-1], goal[::-1]) if axis else (start, goal)
            turns = coarse(grid).turns(start, goal)
            route = [start, *turns, goal]
            assert all(can_see(grid, a, b) for a, b in pairwise(route))
            length = sum(octile(a, b) for a, b in pairwise(route))
            assert length <= 1.03 * exact_astar(grid, start, goal).cost
            assert len(turns) <= 3


def test_graded_costs_turn_a_route_away():
    cost = np.zeros((300, 300), dtype=np.int8)
    cost[:, 140:160] = 90
    cost[20:40, 140:160] = 0
    start, goal = (20, 150), (280, 150)
    assert len(coarse(GridGraph(cost < 0)).turns(start, goal)) == 0
    dear = GridGraph(cost < 0, cost=cost, cost_multiplier=20.0)
    turns = [start, *coarse(dear).turns(start, goal), goal]
    crossing = [np.interp(150, [a[0], b[0]], [a[1], b[1]]) for a, b in pairwise(turns)
                if a[0] < 150 <= b[0]]  # fmt: skip
    assert len(crossing) == 1
    assert 20 <= crossing[0] <= 40


@pytest.mark.parametrize('graded', [False, True])
def test_a_search_led_by_the_turns_is_nearly_as_cheap_as_can_be(graded):
    ratios = []
    for seed in range(12):
        blocked, (start, goal) = rectangles(seed, 260 + 20 * seed)
        cost = np.random.default_rng(seed).integers(0, 100, blocked.shape) if graded else None
        grid = GridGraph(blocked, cost=cost)
        led = guided(grid, start, goal, coarse(grid).turns(start, goal))
        ratios.append(led.cost / exact_astar(grid, start, goal).cost)
    assert np.mean(ratios) < 1.04
    assert max(ratios) < 1.2


@pytest.mark.parametrize('shift', [2, 3])
def test_leaving_out_moves_across_open_tiles_changes_no_cost(shift):
    pruned = 0
    for seed in range(8):
        blocked, (start, goal) = rectangles(seed, 200, count=15)
        graph = coarse(GridGraph(blocked), shift)
        costs = []
        for _ in range(2):
            nodes = graph._tiles.tables, graph._is_open, graph._places, graph._prices
            points, cost = kernels.route(nodes, start, goal, 10**9)
            assert points
            costs.append(cost)
            pruned += int(graph._is_open.sum())
            graph._is_open[:] = False
        assert costs[0] == pytest.approx(costs[1], abs=1e-6)
    assert pruned > 100


def test_a_route_gives_up_after_so_many_nodes():
    graph = coarse(GridGraph(np.zeros((100, 100), dtype=bool)))
    with pytest.raises(TimeoutError, match='5 nodes'):
        graph.turns((1, 1), (90, 90), 5)
    assert len(graph.turns((1, 1), (90, 90))) == 0


def test_cells_off_the_grid_are_refused():
    graph = coarse(GridGraph(np.zeros((10, 10), dtype=bool)))
    for start, goal in (((-1, 0), (1, 1)), ((1, 1), (10, 0))):
        with pytest.raises(ValueError, match='off a grid'):
            graph.turns(start, goal)
