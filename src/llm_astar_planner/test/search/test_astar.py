"""The exact A* against a plain Dijkstra, published lengths and small grids worked by hand."""

import csv
import heapq
import math
import os
import threading
from fractions import Fraction
from itertools import pairwise, product
from pathlib import Path

import numpy as np
import pytest
from grids import assert_path, dijkstra, queries, shortest_path
from hypothesis import given, settings
from llm_astar_msgs_adapter.maps.movingai import load_map
from llm_astar_planner.search import grid_graph
from llm_astar_planner.search._kernels.astar import CANONICAL_SUCCESSORS, STEP_X, STEP_Y
from llm_astar_planner.search.astar import exact_astar
from llm_astar_planner.search.grid_graph import GridGraph
from llm_astar_planner.search.guided import guided
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
    assert 1.0 <= result.suboptimality_bound <= grid.rounding
    assert truth * (1 - 1e-7) <= result.cost <= result.suboptimality_bound * truth * (1 + 1e-7)
    assert result.lower_bound <= truth * (1 + 1e-7)
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
    huge.set_units(*(value * 4000 for value in grid_graph.FINE_UNITS))
    huge.ring = 1 << 20
    result = exact_astar(huge, (0, 0), (399, 1))
    assert result.length == fine.length
    assert result.cost == pytest.approx(fine.cost, rel=1e-4)
    assert shortest_path(huge, (0, 0), (399, 1))[1] == result.cost


# The square root of 2, to 40 digits.
ROOT = Fraction(math.isqrt(2 * 10**80), 10**40)


def exact_costs(costs, multiplier, start):
    """Return the least cost from a cell to each other one in exact fractions, by Dijkstra."""
    height, width = costs.shape
    prices = [[Fraction(multiplier) * int(cost) / 100 for cost in row] for row in costs]
    least, heap = {start: Fraction(0)}, [(Fraction(0), start)]
    while heap:
        done, (x, y) = heapq.heappop(heap)
        if done > least[x, y]:
            continue
        for dx, dy in product((-1, 0, 1), repeat=2):
            near = x + dx, y + dy
            if (dx or dy) and 0 <= near[0] < width and 0 <= near[1] < height:
                length = ROOT if dx and dy else Fraction(1)
                price = (prices[y][x] + prices[near[1]][near[0]]) / 2
                cost = done + length * (1 + price)
                if cost < least.get(near, cost + 1):
                    least[near] = cost
                    heapq.heappush(heap, (cost, near))
    return least


def exact_cost_of(path, costs, multiplier):
    """Return what a path costs in exact fractions."""
    total = Fraction(0)
    for (x, y), (to_x, to_y) in pairwise(path.tolist()):
        price = Fraction(multiplier) * (int(costs[y, x]) + int(costs[to_y, to_x])) / 200
        total += (ROOT if x != to_x and y != to_y else 1) * (1 + price)
    return total


@pytest.mark.parametrize('multiplier', [0.3, 2.0, 7.77])
def test_every_claim_holds_for_exact_costs(multiplier):
    random = np.random.default_rng(3)
    worst = 1.0
    for _ in range(12):
        costs = random.choice([0, 1, 5, 6, 37, 98], (14, 18)).astype(np.int8)
        grid = GridGraph(costs > 100, cost=costs, cost_multiplier=multiplier)
        start, goal = (0, int(random.integers(14))), (17, int(random.integers(14)))
        optimum = exact_costs(costs, multiplier, start)[goal]
        waypoints = random.uniform(0, 14, (2, 2))
        for found in (
            exact_astar(grid, start, goal),
            guided(grid, start, goal, waypoints),
            guided(grid, start, goal, waypoints, max_suboptimality=1.02),
        ):
            cost = exact_cost_of(found.path, costs, multiplier)
            # What floats lose.
            slack = Fraction(1 + 1e-12)
            assert found.cost == pytest.approx(float(cost), rel=1e-12)
            assert Fraction(found.lower_bound) <= optimum * slack
            assert cost <= Fraction(found.suboptimality_bound) * optimum * slack
            worst = max(worst, exact_astar(grid, start, goal).suboptimality_bound)
        assert found.suboptimality_bound <= 1.02
    assert 1.0 < worst <= grid.rounding


def ways_around(move, mask):
    """The shortest ways from the previous cell to each neighbour, around a cell at (0, 0).

    The cell was entered by `move` and has the legal moves `mask`, whose ends are surely free. A
    way is (length, whether its last move is diagonal); of equal ones a straight end is better.
    """
    steps = list(zip(STEP_X.tolist(), STEP_Y.tolist()))
    before = (-steps[move][0], -steps[move][1])
    free = {step for bit, step in enumerate(steps) if mask >> bit & 1} | {before}
    ways, known = {before: (0.0, False)}, None
    while ways != known:
        known = dict(ways)
        for (x, y), (length, _) in known.items():
            for step_x, step_y in steps:
                end, is_diagonal = (x + step_x, y + step_y), bool(step_x and step_y)
                corners = {(x + step_x, y), (x, y + step_y)} if is_diagonal else {end}
                if end in free and corners <= free | {(0, 0)}:
                    way = round(length + math.hypot(step_x, step_y), 9), is_diagonal
                    ways[end] = min(ways.get(end, way), way)
    return ways


def test_a_move_is_left_out_where_the_cell_before_reaches_its_end_as_well_around_this_cell():
    for move in range(8):
        for mask in range(256):
            ways, kept = ways_around(move, mask), 0
            for bit in range(8):
                end = int(STEP_X[bit]), int(STEP_Y[bit])
                direct = round(math.hypot(*end) + (1.0 if move < 4 else math.sqrt(2.0)), 9)
                around, ends_diagonal = ways.get(end, (math.inf, True))
                is_equal = around == direct and bit >= 4 and not ends_diagonal
                if mask >> bit & 1 and not (around < direct or is_equal):
                    kept |= 1 << bit
            assert CANONICAL_SUCCESSORS[move << 8 | mask] == kept, (move, mask)
