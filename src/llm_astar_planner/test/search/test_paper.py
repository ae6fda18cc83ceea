"""The paper's methods against its pseudocode in plain Python, and small grids worked by hand."""

import heapq
import itertools
import math
import time
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from llm_astar_planner.search import paper
from llm_astar_planner.search.arrays import no_stop
from llm_astar_planner.search.grid_graph import GridGraph
from llm_astar_planner.search.paper import HEURISTICS, PAPER_METHODS
from llm_astar_planner.search.problem import SearchProblem
from llm_astar_planner.search.result import SearchStatus

MOVES = [(-1, 0), (-1, 1), (0, 1), (1, 1), (1, 0), (1, -1), (0, -1), (-1, -1)]
DISTANCES = {
    'euclidean': lambda dx, dy: math.sqrt(dx * dx + dy * dy),
    'octile': lambda dx, dy: max(dx, dy) + (math.sqrt(2) - 1) * min(dx, dy),
    'chebyshev': max,
    'manhattan': lambda dx, dy: dx + dy,
}


def plain_search(blocked, start, goal, targets=(), weight=1.0, decay=1.0, kind='euclidean'):
    """Search by the paper's pseudocode, with dictionaries; corners may be cut.

    Returns (expansions, storage, g of the goal or None).
    """

    def distance(cell, other):
        return DISTANCES[kind](abs(cell[0] - other[0]), abs(cell[1] - other[1]))

    def key(cell):
        estimate = max(1.0, state['weight']) * distance(cell, goal)
        if targets:
            estimate += distance(cell, targets[state['target']])
        return g[cell] + estimate

    def rekey():
        queue[:] = [(key(cell), cell) for _, cell in queue]
        heapq.heapify(queue)

    state = {'weight': weight, 'target': 0}
    g = {start: 0.0}
    queue = [(key(start), start)]
    closed = set()
    for pops in itertools.count(1):
        if not queue:
            return pops - 1, len(g), None
        if decay != 1.0:
            state['weight'] = weight * decay ** (pops - 1)
            rekey()
        _, cell = heapq.heappop(queue)
        closed.add(cell)
        if cell == goal:
            return pops, len(g), g[goal]
        for dx, dy in MOVES:
            neighbour = (cell[0] + dx, cell[1] + dy)
            if targets and neighbour == tuple(targets[state['target']]) != goal:
                state['target'] += 1
                rekey()
            if not (0 <= neighbour[0] < blocked.shape[1] and 0 <= neighbour[1] < blocked.shape[0]):
                continue
            if neighbour in closed:
                continue
            legal = not blocked[neighbour[1], neighbour[0]] and not blocked[cell[1], cell[0]]
            new_g = g[cell] + math.hypot(dx, dy) if legal else math.inf
            g.setdefault(neighbour, math.inf)
            if new_g < g[neighbour]:
                g[neighbour] = new_g
                heapq.heappush(queue, (key(neighbour), neighbour))


def search(name, blocked, start, goal, targets=(), corner_cutting=True, weight=2.0, **options):
    """Search by one of the paper's methods."""
    graph = GridGraph(blocked, corner_cutting=corner_cutting)
    return PAPER_METHODS[name](
        SearchProblem(graph, start, goal, targets, weight=weight, **options)
    )


@st.composite
def problems(draw):
    """Draw a small grid of random obstacles with free start and goal."""
    width, height = draw(st.integers(2, 14)), draw(st.integers(2, 14))
    seed = draw(st.integers(0, 2**32 - 1))
    density = draw(st.sampled_from([0.0, 0.2, 0.35]))
    blocked = np.random.default_rng(seed).random((height, width)) < density
    cells = st.tuples(st.integers(0, width - 1), st.integers(0, height - 1))
    start, goal = draw(cells), draw(cells)
    blocked[start[1], start[0]] = blocked[goal[1], goal[0]] = False
    targets = draw(st.lists(cells | st.tuples(st.just(2.5), st.integers(0, 5)), max_size=5))
    return blocked, start, goal, [*targets, goal]


def check(result, expected):
    expansions, storage, length = expected
    assert (result.expansions, result.storage) == (expansions, storage)
    if length is None:
        assert result.status is SearchStatus.EXHAUSTED
        assert len(result.path) == 0
    else:
        assert result.status is SearchStatus.FOUND
        assert result.length == pytest.approx(length, abs=1e-9)


@settings(max_examples=150)
@given(problems(), st.sampled_from(sorted(HEURISTICS)))
def test_every_method_counts_as_the_pseudocode_does(problem, heuristic):
    blocked, start, goal, targets = problem
    settings_of = {
        'astar': {},
        'weighted_astar': {'weight': 1.7},
        'dynamic_weighted_astar': {'weight': 2.0, 'decay': 0.99},
        'llm_astar': {'targets': targets},
    }
    for name, extra in settings_of.items():
        result = search(name, blocked, start, goal, targets, heuristic=heuristic, weight=1.7)
        check(result, plain_search(blocked, start, goal, kind=heuristic, **extra))


def grid(*rows):
    """Read a grid from text, its first row at the top: # is blocked."""
    return np.array([[mark == '#' for mark in row] for row in reversed(rows)])


WALL = grid(
    '.......',
    '...#...',
    '...#...',
    '...#...',
    '...#...',
)


def test_counts_around_a_wall():
    counts = {
        name: (result.expansions, result.storage, round(result.length, 6))
        for name in PAPER_METHODS
        if name in ('astar', 'weighted_astar', 'dynamic_weighted_astar', 'llm_astar')
        for result in [search(name, WALL, (1, 1), (5, 1), [(3, 4), (5, 1)])]
    }
    assert counts == {
        'astar': (17, 28, 7.656854),
        'weighted_astar': (13, 31, 7.656854),
        'dynamic_weighted_astar': (14, 31, 7.656854),
        'llm_astar': (13, 31, 7.656854),
    }


def test_the_path_runs_over_the_wall():
    path = search('astar', WALL, (1, 1), (5, 1), []).path.tolist()
    assert path[0] == [1, 1]
    assert path[-1] == [5, 1]
    assert [3, 4] in path


def test_with_a_target_between_lattice_points_the_goal_is_still_reached():
    free = np.zeros((9, 9), dtype=bool)
    result = search('llm_astar', free, (1, 1), (7, 7), [(2.5, 6.0), (7, 7)])
    assert result.status is SearchStatus.FOUND


def test_a_blocked_target_still_counts_as_reached():
    blocked = np.zeros((9, 9), dtype=bool)
    blocked[4, 4] = True
    met = search('llm_astar', blocked, (1, 4), (7, 4), [(4, 4), (7, 4)])
    assert met.status is SearchStatus.FOUND
    assert met.expansions == plain_search(blocked, (1, 4), (7, 4), [(4, 4), (7, 4)])[0]


def test_passing_between_diagonal_obstacles_needs_corner_cutting():
    gap = grid('.#', '#.')
    allowed = search('astar', gap, (0, 1), (1, 0), [])
    assert allowed.length == pytest.approx(math.sqrt(2))
    forbidden = search('astar', gap, (0, 1), (1, 0), [], corner_cutting=False)
    assert forbidden.status is SearchStatus.EXHAUSTED


def test_without_corner_cutting_the_path_goes_around_a_corner():
    corner = grid('..', '#.')
    cut = search('astar', corner, (0, 1), (1, 0), [])
    walked = search('astar', corner, (0, 1), (1, 0), [], corner_cutting=False)
    assert cut.length == pytest.approx(math.sqrt(2))
    assert walked.length == pytest.approx(2.0)


@pytest.mark.parametrize('name', sorted(PAPER_METHODS))
def test_start_equal_to_goal_is_a_path_of_one_cell(name):
    free = np.zeros((5, 5), dtype=bool)
    result = search(name, free, (2, 3), (2, 3), [(2, 3)])
    assert result.path.tolist() == [[2, 3]]
    assert result.length == 0.0


@pytest.mark.parametrize('name', sorted(PAPER_METHODS))
def test_a_raised_stop_flag_stops_the_search(name):
    stop = no_stop()
    stop[0] = 1
    free = np.zeros((50, 50), dtype=bool)
    result = search(name, free, (1, 1), (48, 40), [(48, 40)], stop=stop)
    assert result.status is SearchStatus.STOPPED
    assert len(result.path) == 0


@settings(max_examples=20)
@given(problems())
def test_a_search_in_slices_is_the_same_search(problem):
    blocked, start, goal, targets = problem
    for name in PAPER_METHODS:
        whole = search(name, blocked, start, goal, targets)
        with pytest.MonkeyPatch.context() as patch:
            patch.setattr(paper, 'SLICE', 1)
            patch.setattr(paper, '_FIRST_HEAP', 9)
            sliced = search(name, blocked, start, goal, targets)
        assert sliced.status is whole.status
        assert (sliced.expansions, sliced.storage) == (whole.expansions, whole.storage)
        np.testing.assert_array_equal(sliced.path, whole.path)
        np.testing.assert_array_equal(sliced.expanded, whole.expanded)


@pytest.mark.parametrize('name', sorted(PAPER_METHODS))
def test_a_search_ends_at_its_deadline(name):
    blocked = np.zeros((2000, 2000), dtype=bool)
    blocked[1:, 1000] = True
    graph, start, goal = GridGraph(blocked, corner_cutting=True), (800, 1900), (1200, 1900)
    targets = [(900, 1950), goal]
    problem = SearchProblem(graph, start, goal, targets, heuristic='chebyshev')
    # A busy machine may begin to search late.
    for seconds in (0.1, 0.4, 1.6):
        result = PAPER_METHODS[name](replace(problem, deadline=time.monotonic() + seconds))
        assert result.status is SearchStatus.STOPPED
        if result.expansions:
            break
    assert result.expansions > 0
    past = search(name, blocked, start, start, [], deadline=time.monotonic())
    assert (past.status, past.expansions) == (SearchStatus.STOPPED, 0)


def test_expanded_cells_are_returned_only_if_wanted():
    result = search('astar', WALL, (1, 1), (5, 1), [], want_expanded=False)
    assert result.expanded.shape == (0, 0)
    assert result.expansions > 0


def test_expanded_cells_are_marked_by_row_and_column():
    blocked = grid('#####', '#...#', '#####')
    result = search('astar', blocked, (1, 1), (3, 1), [])
    expected = np.zeros_like(blocked)
    expanded = [(1, 1), (2, 1), (3, 1)]
    for x, y in expanded:
        expected[y, x] = True
    np.testing.assert_array_equal(result.expanded, expected)
