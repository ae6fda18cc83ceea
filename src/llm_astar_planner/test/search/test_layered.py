"""The layered search: exact against a plain search over (cell, what was visited), by the rules."""

import heapq
import itertools
import math
import threading
import time

import numpy as np
import pytest
from grids import is_move
from hypothesis import given, settings
from hypothesis import strategies as st
from llm_astar_planner.search import layered
from llm_astar_planner.search.astar import exact_astar
from llm_astar_planner.search.grid_graph import GridGraph
from llm_astar_planner.search.layered import (
    LayersTooLargeError,
    VisitProblem,
    VisitProblemError,
    visit_search,
)
from llm_astar_planner.search.result import SearchStatus


class Rules:
    """The rules of a problem, taken literally; a memory is (visits counted, firsts entered)."""

    def __init__(self, graph, goal, problem):
        self.graph, self.goal, self.problem = graph, goal, problem

    def enter(self, memory, cell):
        """The memory after entering a cell."""
        x, y = cell
        counted, entered = memory
        inside = {index for index, mask in enumerate(self.problem.regions) if mask[y, x]}
        firsts = {first for first, _, _ in self.problem.before}
        for position, group in enumerate(self.problem.visits):
            earlier = {
                (number, region)
                for number in range(position)
                for region in self.problem.visits[number]
            }
            if earlier <= counted:
                counted |= {(position, region) for region in group if region in inside}
        return frozenset(counted), frozenset(entered | (inside & firsts))

    def price(self, memory, cell):
        """What a cell costs more per cell of length, inf if it is forbidden."""
        x, y = cell
        price = 0.0 if self.problem.price is None else float(self.problem.price[y, x])
        for first, second, rate in self.problem.before:
            if self.problem.regions[second][y, x] and first not in memory[1]:
                price += rate
        return price

    def done(self, memory, cell):
        """Whether a path may end here."""
        wanted = {
            (position, region)
            for position, group in enumerate(self.problem.visits)
            for region in group
        }
        if self.problem.goals is not None:
            return wanted <= memory[0] and self.problem.goals[cell[1], cell[0]]
        return wanted <= memory[0] and cell == self.goal

    def move(self, cell, memory, other, other_memory):
        """The cost of a move in cells."""
        graph = self.graph
        diagonal = cell[0] != other[0] and cell[1] != other[1]
        units = length = graph.diagonal if diagonal else graph.straight
        if graph.cell_surcharge.size:
            surcharge = graph.cell_surcharge.reshape(graph.blocked.shape).astype(int)
            units += length * (surcharge[cell[1], cell[0]] + surcharge[other[1], other[0]]) >> 9
        mean = (self.price(memory, cell) + self.price(other_memory, other)) / 2.0
        return (units + length * mean) / graph.straight


def brute_force(graph, start, goal, problem):
    """The least cost, by Dijkstra over (cell, memory)."""
    rules = Rules(graph, goal, problem)
    empty = (frozenset(), frozenset())
    if graph.blocked[start[1], start[0]]:
        return math.inf
    memory = rules.enter(empty, start)
    if math.isinf(rules.price(memory, start)):
        return math.inf
    best = {(start, memory): 0.0}
    order = itertools.count()
    heap = [(0.0, next(order), start, memory)]
    while heap:
        cost, _, cell, memory = heapq.heappop(heap)
        if cost > best[cell, memory]:
            continue
        if rules.done(memory, cell):
            return cost
        for dx, dy in itertools.product((-1, 0, 1), repeat=2):
            other = cell[0] + dx, cell[1] + dy
            if (dx, dy) == (0, 0) or not is_move(graph, cell, other):
                continue
            after = rules.enter(memory, other)
            new = cost + rules.move(cell, memory, other, after)
            if new < best.get((other, after), math.inf):
                best[other, after] = new
                heapq.heappush(heap, (new, next(order), other, after))
    return math.inf


def assert_result(graph, start, goal, problem, result):
    """The path keeps the rules and costs what is said, and the visits count where is said."""
    rules = Rules(graph, goal, problem)
    cells = [(int(x), int(y)) for x, y in result.path]
    assert cells[0] == start
    cost, length = 0.0, 0.0
    memories = [rules.enter((frozenset(), frozenset()), start)]
    for cell, other in itertools.pairwise(cells):
        assert max(abs(cell[0] - other[0]), abs(cell[1] - other[1])) == 1
        assert is_move(graph, cell, other)
        memories.append(rules.enter(memories[-1], other))
        cost += rules.move(cell, memories[-2], other, memories[-1])
        length += math.hypot(other[0] - cell[0], other[1] - cell[1])
    assert rules.done(memories[-1], cells[-1])
    assert cost == pytest.approx(result.cost, rel=1e-9, abs=1e-12)
    assert length == pytest.approx(result.length)
    visits = [
        (position, region) for position, group in enumerate(problem.visits) for region in group
    ]
    expected = [
        next(index for index, memory in enumerate(memories) if visit in memory[0])
        for visit in visits
    ]
    assert list(result.visited_at) == expected


@st.composite
def problems(draw):
    """A small grid with a problem on it: regions that overlap, visits, rules, goals, prices."""
    height, width = draw(st.integers(1, 9)), draw(st.integers(1, 9))
    random = np.random.default_rng(draw(st.integers(0, 2**32 - 1)))
    blocked = random.random((height, width)) < draw(st.sampled_from([0.0, 0.15, 0.3]))
    if draw(st.booleans()) and height > 4:
        blocked[height // 2] = True
        blocked[height // 2, random.integers(width)] = False
    start, goal = ((int(x), int(y)) for x, y in random.integers(0, (width, height), (2, 2)))
    blocked[start[1], start[0]] = blocked[goal[1], goal[0]] = False
    cost = random.integers(0, 101, blocked.shape) if draw(st.integers(0, 3)) == 0 else None
    graph = GridGraph(blocked, corner_cutting=draw(st.booleans()), cost=cost)
    count = draw(st.integers(0, 5))
    regions = tuple(random_region(random, blocked.shape) for _ in range(count))
    numbers = st.integers(0, count - 1)
    visits, before = (), ()
    if count:
        groups = st.lists(numbers, min_size=0, max_size=3).map(tuple)
        visits = tuple(draw(st.lists(groups, max_size=3)))
        rates = st.sampled_from([math.inf, 0.0, 0.5, 7.0, 1000.0])
        before = tuple(draw(st.lists(st.tuples(numbers, numbers, rates), max_size=2)))
    goals = random_region(random, blocked.shape) if draw(st.integers(0, 3)) == 0 else None
    price = None
    if draw(st.integers(0, 2)) == 0:
        steps = np.array([0.0, 0.1, 6.0, 1000.0, 1e6], dtype=np.float32)
        price = random.choice(steps, blocked.shape, p=[0.6, 0.1, 0.1, 0.1, 0.1])
    return graph, start, goal, VisitProblem(regions, visits, before, goals, price)


def random_region(random, shape):
    """A box, a cell, or some cells anywhere."""
    height, width = shape
    mask = np.zeros(shape, dtype=bool)
    kind = random.integers(4)
    if kind == 0:
        return random.random(shape) < 0.1
    x, y = random.integers(width), random.integers(height)
    size = 1 if kind == 1 else random.integers(1, 6)
    mask[y : y + size, x : x + random.integers(1, size + 1)] = True
    return mask


def check(graph, start, goal, problem):
    """Hold one search against the brute force; tell whether there is a path."""
    truth = brute_force(graph, start, goal, problem)
    result = visit_search(graph, start, goal, problem)
    if math.isinf(truth):
        assert result.status is SearchStatus.EXHAUSTED
        assert len(result.path) == 0
        assert result.visited_at == ()
        assert result.lower_bound == math.inf
        return False
    assert result.status is SearchStatus.FOUND
    assert result.cost == pytest.approx(truth, rel=1e-9, abs=1e-12)
    assert result.suboptimality_bound == graph.rounding
    assert_result(graph, start, goal, problem, result)
    return True


@settings(max_examples=600, deadline=None)
@given(problems())
def test_it_is_exact_on_random_problems(problem):
    check(*problem)


def test_it_is_exact_on_seeded_problems_that_have_paths():
    random = np.random.default_rng(7)
    found = 0
    for _ in range(150):
        blocked = random.random((12, 12)) < 0.2
        start, goal = ((int(x), int(y)) for x, y in random.integers(0, 12, (2, 2)))
        blocked[start[1], start[0]] = blocked[goal[1], goal[0]] = False
        regions = tuple(random_region(random, blocked.shape) & ~blocked for _ in range(5))
        visits = (((0,), (1,), (2,)), ((0, 1, 2),), ((0, 1), (2,), (0,)))[random.integers(3)]
        rate = (math.inf, 5.0, 1e6)[random.integers(3)]
        problem = VisitProblem(regions, visits, ((3, 4, rate), (0, 2, rate)))
        found += check(GridGraph(blocked, corner_cutting=True), start, goal, problem)
    assert found > 60


def free_graph(size=20):
    return GridGraph(np.zeros((size, size), dtype=bool))


def box(shape, x0, x1, y0, y1):
    mask = np.zeros(shape, dtype=bool)
    mask[y0 : y1 + 1, x0 : x1 + 1] = True
    return mask


@pytest.mark.parametrize('corner_cutting', [False, True])
@pytest.mark.parametrize('graded', [False, True])
def test_without_wishes_it_costs_what_the_exact_search_does(corner_cutting, graded):
    random = np.random.default_rng(5)
    for _ in range(20):
        blocked = random.random((60, 70)) < 0.25
        start, goal = ((int(x), int(y)) for x, y in random.integers(0, 60, (2, 2)))
        blocked[start[1], start[0]] = blocked[goal[1], goal[0]] = False
        cost = random.integers(0, 101, blocked.shape) if graded else None
        graph = GridGraph(blocked, corner_cutting=corner_cutting, cost=cost)
        exact = exact_astar(graph, start, goal)
        result = visit_search(graph, start, goal, VisitProblem(()))
        assert result.status is exact.status
        assert result.cost == pytest.approx(exact.cost, rel=graph.rounding - 1.0)
        assert result.layers == 1


def test_the_order_of_visits_decides_the_path():
    graph = free_graph()
    near, far = box((20, 20), 5, 5, 0, 0), box((20, 20), 15, 15, 0, 0)
    ordered = visit_search(graph, (0, 0), (19, 0), VisitProblem((near, far), ((1,), (0,))))
    assert ordered.length == 15 + 10 + 14
    assert ordered.visited_at == (15, 25)
    free = visit_search(graph, (0, 0), (19, 0), VisitProblem((near, far), ((1, 0),)))
    assert free.length == 19
    assert free.visited_at == (15, 5)


def test_one_cell_counts_for_several_groups():
    graph = free_graph()
    here = box((20, 20), 4, 6, 0, 3)
    problem = VisitProblem((here, here.copy()), ((0,), (1,), (0,)))
    result = visit_search(graph, (5, 0), (5, 0), problem)
    assert result.length == 0.0
    assert result.visited_at == (0, 0, 0)


def test_a_region_is_forbidden_until_another_was_entered():
    graph = free_graph()
    first, second = box((20, 20), 0, 0, 19, 19), box((20, 20), 10, 10, 0, 19)
    forbidden = VisitProblem((first, second), before=((0, 1, math.inf),))
    result = visit_search(graph, (0, 0), (19, 0), forbidden)
    assert [0, 19] in result.path.tolist()
    # Dear instead of forbidden: crossing costs half the price on each side of the line.
    dear = VisitProblem((first, second), before=((0, 1, 5.0),))
    assert visit_search(graph, (0, 0), (19, 0), dear).cost == 19 + 5.0


def test_a_start_on_a_forbidden_cell_has_no_path():
    graph = free_graph()
    first, second = box((20, 20), 0, 0, 19, 19), box((20, 20), 0, 3, 0, 3)
    problem = VisitProblem((first, second), before=((0, 1, math.inf),))
    assert visit_search(graph, (0, 0), (9, 9), problem).status is SearchStatus.EXHAUSTED


def test_prices_count_before_lengths_and_lengths_stay_exact():
    graph = free_graph(60)
    price = np.zeros((60, 60), dtype=np.float32)
    price[:, 30] = 1e6
    price[59, 30] = 1e3
    result = visit_search(graph, (0, 0), (59, 0), VisitProblem((), price=price))
    assert [30, 59] in result.path.tolist()
    # Straight across the cheapest cell of the line, so that it is paid for one cell of length.
    assert result.length == pytest.approx(57 * math.sqrt(2.0) + 63.0)
    assert result.cost - result.length == pytest.approx(1e3, rel=1e-6)


def test_the_nearest_of_several_goals_is_chosen():
    graph = free_graph()
    goals = box((20, 20), 10, 19, 5, 5)
    result = visit_search(graph, (0, 5), (0, 0), VisitProblem((), goals=goals))
    assert result.path[-1].tolist() == [10, 5]


@pytest.mark.parametrize('visits', [((0,),), ((0, 1),), ((1,), (0,))])
def test_an_unreachable_region_has_no_path(visits):
    blocked = np.zeros((20, 20), dtype=bool)
    blocked[10:13, 10:13] = True
    blocked[11, 11] = False
    regions = box((20, 20), 11, 11, 11, 11), box((20, 20), 3, 3, 3, 3)
    result = visit_search(GridGraph(blocked), (0, 0), (19, 19), VisitProblem(regions, visits))
    assert result.status is SearchStatus.EXHAUSTED
    assert result.cost == math.inf


def test_a_region_of_blocked_cells_ends_the_search_at_once():
    blocked = np.zeros((20, 20), dtype=bool)
    blocked[5, 5] = True
    problem = VisitProblem((box((20, 20), 5, 5, 5, 5),), ((0,),))
    result = visit_search(GridGraph(blocked), (0, 0), (19, 19), problem)
    assert result.status is SearchStatus.EXHAUSTED
    assert result.expansions == 0


def long_problem():
    """Regions in the corners of an open map that prices make hard: seconds of search."""
    size = 400
    random = np.random.default_rng(0)
    price = (random.random((size, size)) * 1e3).astype(np.float32)
    corners = [(0, 0), (size - 5, 0), (0, size - 5), (size - 5, size - 5)]
    regions = tuple(box((size, size), x, x + 4, y, y + 4) for x, y in corners)
    return free_graph(size), VisitProblem(regions, ((0, 1, 2, 3),), price=price)


def test_a_deadline_that_has_passed_stops_the_search():
    graph, problem = long_problem()
    result = visit_search(graph, (200, 200), (210, 200), problem, deadline=time.monotonic())
    assert result.status is SearchStatus.STOPPED
    assert len(result.path) == 0
    assert result.lower_bound < math.inf


def test_a_stop_flag_of_another_thread_ends_the_search():
    graph, problem = long_problem()
    stop = np.zeros(1, dtype=np.uint8)
    threading.Timer(0.02, stop.fill, (1,)).start()
    result = visit_search(graph, (200, 200), (210, 200), problem, stop=stop)
    assert result.status is SearchStatus.STOPPED
    assert result.visited_at == ()


def test_more_memory_than_the_limit_is_refused(monkeypatch):
    monkeypatch.setattr(layered, 'MAX_BYTES', 4 * 9 * 400 * 400)
    graph, problem = long_problem()
    with pytest.raises(LayersTooLargeError, match='GB'):
        visit_search(graph, (200, 200), (210, 200), problem)


def test_more_layers_than_the_limit_are_refused():
    graph = free_graph()
    regions = tuple(box((20, 20), x, x, 3, 3) for x in range(16))
    with pytest.raises(LayersTooLargeError, match='any order'):
        visit_search(graph, (0, 0), (9, 9), VisitProblem(regions, (tuple(range(16)), (0,))))


def test_problems_that_do_not_fit_the_grid_are_refused():
    graph, mask = free_graph(), box((20, 20), 0, 0, 0, 0)
    bad = {
        'regions: 17': VisitProblem((mask,) * 17),
        r'regions\[1\]: shape': VisitProblem((mask, mask[1:])),
        'no region 1': VisitProblem((mask,), ((1,),)),
        'before: price': VisitProblem((mask,), before=((0, 0, math.nan),)),
        'price: not all': VisitProblem((), price=np.full((20, 20), math.nan, dtype=np.float32)),
        'goals: shape': VisitProblem((), goals=np.zeros((2, 2), dtype=bool)),
    }
    for message, problem in bad.items():
        with pytest.raises(VisitProblemError, match=message):
            visit_search(graph, (0, 0), (1, 1), problem)
