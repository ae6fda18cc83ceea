"""The product search: exact against a plain search over (cell, states of automata)."""

import heapq
import itertools
import math
import threading
import time

import numpy as np
import pytest
from grids import is_move
from llm_astar_planner.search import automata, product
from llm_astar_planner.search.astar import exact_astar
from llm_astar_planner.search.automata import Automaton
from llm_astar_planner.search.grid_graph import GridGraph
from llm_astar_planner.search.landmarks import Landmarks
from llm_astar_planner.search.product import (
    ProductProblem,
    ProductProblemError,
    ProductTooLargeError,
    product_search,
)
from llm_astar_planner.search.result import SearchStatus


class Rules:
    """A problem taken literally; a memory is the tuple of the automata's states."""

    def __init__(self, graph, goal, problem):
        self.graph, self.goal, self.problem = graph, goal, problem
        self.before_start = (0,) * len(problem.automata)

    def letter(self, automaton, cell):
        """What an automaton reads of a cell."""
        inside = [
            bool(self.problem.regions[number][cell[1], cell[0]]) for number in automaton.regions
        ]
        return sum(2**bit for bit, is_inside in enumerate(inside) if is_inside)

    def enter(self, memory, cell):
        """The memory after a cell was read."""
        return tuple(
            int(automaton.after[state, self.letter(automaton, cell)])
            for state, automaton in zip(memory, self.problem.automata)
        )

    def price(self, memory, cell):
        """What a cell costs more per cell of length, inf if it is forbidden."""
        price = 0.0 if self.problem.price is None else float(self.problem.price[cell[1], cell[0]])
        for state, automaton in zip(memory, self.problem.automata):
            if automaton.price is not None:
                price += float(automaton.price[state, self.letter(automaton, cell)])
        return price

    def done(self, memory, cell):
        """Whether a path may end here."""
        pairs = zip(memory, self.problem.automata)
        if not all(automaton.accepting[state] for state, automaton in pairs):
            return False
        goals = self.problem.goals
        return cell == self.goal if goals is None else bool(goals[cell[1], cell[0]])

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
    memory = rules.enter(rules.before_start, start)
    if graph.blocked[start[1], start[0]] or math.isinf(rules.price(memory, start)):
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
    """The path keeps the rules and costs what is said, and its trace is as the rules have it."""
    rules = Rules(graph, goal, problem)
    cells = [(int(x), int(y)) for x, y in result.path]
    assert cells[0] == start
    cost, length = 0.0, 0.0
    memories = [rules.enter(rules.before_start, start)]
    for cell, other in itertools.pairwise(cells):
        assert max(abs(cell[0] - other[0]), abs(cell[1] - other[1])) == 1
        assert is_move(graph, cell, other)
        memories.append(rules.enter(memories[-1], other))
        cost += rules.move(cell, memories[-2], other, memories[-1])
        length += math.hypot(other[0] - cell[0], other[1] - cell[1])
    assert rules.done(memories[-1], cells[-1])
    assert cost == pytest.approx(result.cost, rel=1e-9, abs=1e-12)
    assert length == pytest.approx(result.length)
    assert [tuple(states) for states in result.trace.tolist()] == memories


def random_problem(random):
    """A small grid with a problem on it: overlapping regions, automata, goals, prices."""
    height, width = (int(side) for side in random.integers(6, 15, 2))
    blocked = random.random((height, width)) < random.choice([0.0, 0.15, 0.3])
    if random.random() < 0.4:
        blocked[height // 2] = True
        blocked[height // 2, random.integers(width)] = False
    start, goal = ((int(x), int(y)) for x, y in random.integers(0, (width, height), (2, 2)))
    if random.random() < 0.97:
        blocked[start[1], start[0]] = blocked[goal[1], goal[0]] = False
    cost = random.integers(0, 101, blocked.shape) if random.random() < 0.3 else None
    graph = GridGraph(blocked, corner_cutting=bool(random.integers(2)), cost=cost)
    count = int(random.integers(1, 6))
    regions = tuple(random_region(random, blocked.shape) for _ in range(count))
    made = tuple(random_automaton(random, count) for _ in range(random.integers(1, 5)))
    goals = random_region(random, blocked.shape) if random.random() < 0.25 else None
    price = None
    if random.random() < 0.3:
        steps = np.array([0.0, 0.1, 6.0, 1000.0, 1e6], dtype=np.float32)
        price = random.choice(steps, blocked.shape, p=[0.6, 0.1, 0.1, 0.1, 0.1])
    return graph, start, goal, ProductProblem(regions, made, goals, price)


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


def random_automaton(random, count):
    """One of any kind over so many regions."""
    first, second = (int(number) for number in random.integers(0, count, 2))
    price = float(random.choice([math.inf, math.inf, 0.0, 0.5, 7.0, 1000.0]))
    kind = random.integers(6)
    if kind == 0:
        sizes = random.integers(0, 4, random.integers(1, 4))
        return automata.visits([random.integers(0, count, size).tolist() for size in sizes])
    if kind == 1:
        return automata.before(first, second, price)
    if kind == 2:
        return automata.then(first, second)
    if kind == 3:
        return automata.never_after(first, second, price)
    if kind == 4:
        least = int(random.integers(0, 3))
        return automata.entries(
            first, second, least, None if random.integers(2) else least + int(random.integers(2))
        )
    states, read = int(random.integers(1, 5)), int(random.integers(0, 3))
    table = random.integers(0, states, (states, 2**read))
    accepting = random.random(states) < 0.6
    prices = random.choice([0.0, 0.0, 3.0, math.inf], table.shape) if random.integers(2) else None
    numbers = tuple(random.integers(0, count, read).tolist())
    return Automaton(numbers, table.astype(np.int16), accepting, prices)


def check(graph, start, goal, problem, landmarks=None):
    """Hold one search against the brute force; tell whether there is a path."""
    truth = brute_force(graph, start, goal, problem)
    result = product_search(graph, start, goal, problem, landmarks=landmarks)
    if math.isinf(truth):
        assert result.status is SearchStatus.EXHAUSTED
        assert len(result.path) == len(result.trace) == 0
        assert result.lower_bound == math.inf
        return False
    assert result.status is SearchStatus.FOUND
    assert result.cost == pytest.approx(truth, rel=1e-9, abs=1e-12)
    assert result.suboptimality_bound == graph.rounding
    assert_result(graph, start, goal, problem, result)
    return True


def check_random_problems(seeds):
    """Hold searches with and without landmarks against the brute force."""
    found = 0
    for seed in seeds:
        graph, start, goal, problem = random_problem(np.random.default_rng(seed))
        landmarks = Landmarks.build(graph, count=3) if seed % 2 else None
        found += check(graph, start, goal, problem, landmarks)
    return found


def test_it_is_exact_on_random_problems():
    assert check_random_problems(range(150)) > 56


@pytest.mark.slow
@pytest.mark.timeout(1800)
def test_it_is_exact_on_5000_random_problems():
    assert check_random_problems(range(10_000, 15_000)) > 2000


def free_graph(size=20):
    return GridGraph(np.zeros((size, size), dtype=bool))


def box(shape, x0, x1, y0, y1):
    mask = np.zeros(shape, dtype=bool)
    mask[y0 : y1 + 1, x0 : x1 + 1] = True
    return mask


@pytest.mark.parametrize('corner_cutting', [False, True])
@pytest.mark.parametrize('graded', [False, True])
@pytest.mark.parametrize('measured', [False, True])
def test_without_automata_it_costs_what_the_exact_search_does(corner_cutting, graded, measured):
    random = np.random.default_rng(5)
    for _ in range(20):
        blocked = random.random((60, 70)) < 0.25
        start, goal = ((int(x), int(y)) for x, y in random.integers(0, 60, (2, 2)))
        blocked[start[1], start[0]] = blocked[goal[1], goal[0]] = False
        cost = random.integers(0, 101, blocked.shape) if graded else None
        graph = GridGraph(blocked, corner_cutting=corner_cutting, cost=cost)
        exact = exact_astar(graph, start, goal)
        landmarks = Landmarks.build(graph) if measured else None
        result = product_search(graph, start, goal, ProductProblem(), landmarks=landmarks)
        assert result.status is exact.status
        assert result.cost == pytest.approx(exact.cost, rel=graph.rounding - 1.0)
        if exact.expansions:
            assert result.states == 1


def changes(result, automaton=0):
    """The indices in the path where the state of an automaton changes."""
    states = [0, *result.trace[:, automaton].tolist()]
    return [index for index, pair in enumerate(itertools.pairwise(states)) if pair[0] != pair[1]]


def test_the_order_of_visits_decides_the_path():
    graph = free_graph()
    regions = box((20, 20), 5, 5, 0, 0), box((20, 20), 15, 15, 0, 0)
    far_first = ProductProblem(regions, (automata.visits([[1], [0]]),))
    ordered = product_search(graph, (0, 0), (19, 0), far_first)
    assert ordered.length == 15 + 10 + 14
    assert changes(ordered) == [15, 25]
    in_any_order = ProductProblem(regions, (automata.visits([[1, 0]]),))
    free = product_search(graph, (0, 0), (19, 0), in_any_order)
    assert free.length == 19
    assert changes(free) == [5, 15]


def test_one_cell_counts_for_several_groups():
    graph = free_graph()
    here = box((20, 20), 4, 6, 0, 3)
    problem = ProductProblem((here, here.copy()), (automata.visits([[0], [1], [0]]),))
    result = product_search(graph, (5, 0), (5, 0), problem)
    assert result.length == 0.0
    assert result.trace.tolist() == [[3]]


def test_a_region_is_forbidden_until_another_was_entered():
    graph = free_graph()
    regions = box((20, 20), 0, 0, 19, 19), box((20, 20), 10, 10, 0, 19)
    forbidden = ProductProblem(regions, (automata.before(0, 1),))
    result = product_search(graph, (0, 0), (19, 0), forbidden)
    assert [0, 19] in result.path.tolist()
    # Dear instead of forbidden: crossing costs half the price on each side of the line.
    dear = ProductProblem(regions, (automata.before(0, 1, 5.0),))
    assert product_search(graph, (0, 0), (19, 0), dear).cost == 19 + 5.0


def test_whoever_enters_one_region_goes_on_to_the_other():
    graph = free_graph()
    regions = box((20, 20), 10, 10, 0, 18), box((20, 20), 0, 0, 19, 19)
    problem = ProductProblem(regions, (automata.then(0, 1),))
    # Round the line is shorter than through it and by way of the other region.
    result = product_search(graph, (0, 0), (19, 0), problem)
    assert [10, 19] in result.path.tolist()
    assert not result.trace.any()
    # Of one that begins in the first region the other is asked.
    assert [0, 19] in product_search(graph, (10, 0), (19, 0), problem).path.tolist()


def test_entries_are_counted():
    graph = free_graph()
    deep, near = box((20, 20), 5, 9, 5, 9), box((20, 20), 3, 11, 3, 11)
    twice = ProductProblem((deep, near), (automata.entries(0, 1, 2),))
    result = product_search(graph, (0, 7), (0, 7), twice)
    # In, out of all that is near and in again, and back.
    assert result.length == 5 + 3 + 3 + 5
    never = ProductProblem((deep, near), (automata.entries(0, 1, 0, 0),))
    assert product_search(graph, (0, 7), (19, 7), never).length > 19
    once = ProductProblem((deep, near), (automata.entries(0, 1, 1, 1),))
    assert product_search(graph, (7, 7), (7, 7), once).length == 0.0


def test_a_start_on_a_forbidden_cell_has_no_path():
    regions = box((20, 20), 0, 0, 19, 19), box((20, 20), 0, 3, 0, 3)
    problem = ProductProblem(regions, (automata.before(0, 1),))
    result = product_search(free_graph(), (0, 0), (9, 9), problem)
    assert result.status is SearchStatus.EXHAUSTED


def test_prices_count_before_lengths_and_lengths_stay_exact():
    graph = free_graph(60)
    price = np.zeros((60, 60), dtype=np.float32)
    price[:, 30] = 1e6
    price[59, 30] = 1e3
    result = product_search(graph, (0, 0), (59, 0), ProductProblem(price=price))
    assert [30, 59] in result.path.tolist()
    # Straight across the cheapest cell of the line, so that it is paid for one cell of length.
    assert result.length == pytest.approx(57 * math.sqrt(2.0) + 63.0)
    assert result.cost - result.length == pytest.approx(1e3, rel=1e-6)


def test_the_nearest_of_several_goals_is_chosen():
    goals = box((20, 20), 10, 19, 5, 5)
    result = product_search(free_graph(), (0, 5), (0, 0), ProductProblem(goals=goals))
    assert result.path[-1].tolist() == [10, 5]


@pytest.mark.parametrize('groups', [[[0]], [[0, 1]], [[1], [0]]])
def test_an_unreachable_region_has_no_path(groups):
    blocked = np.zeros((20, 20), dtype=bool)
    blocked[10:13, 10:13] = True
    blocked[11, 11] = False
    regions = box((20, 20), 11, 11, 11, 11), box((20, 20), 3, 3, 3, 3)
    problem = ProductProblem(regions, (automata.visits(groups),))
    graph = GridGraph(blocked)
    result = product_search(graph, (0, 0), (19, 19), problem)
    assert result.status is SearchStatus.EXHAUSTED
    assert result.cost == math.inf
    proven = product_search(graph, (0, 0), (19, 19), problem, landmarks=Landmarks.build(graph))
    assert proven.status is SearchStatus.EXHAUSTED
    assert proven.expansions == 0


def test_a_region_of_blocked_cells_ends_the_search_at_once():
    blocked = np.zeros((20, 20), dtype=bool)
    blocked[5, 5] = True
    problem = ProductProblem((box((20, 20), 5, 5, 5, 5),), (automata.visits([[0]]),))
    result = product_search(GridGraph(blocked), (0, 0), (19, 19), problem)
    assert result.status is SearchStatus.EXHAUSTED
    assert result.expansions == 0


def test_states_from_which_no_path_may_end_are_not_entered():
    regions = box((20, 20), 0, 9, 0, 19), box((20, 20), 0, 19, 0, 9)
    # The first automaton never accepts after its region, the second must not leave its own.
    once_in = Automaton((0,), np.array([[0, 1], [1, 1]], dtype=np.int16), np.array([True, False]))
    problem = ProductProblem(regions, (once_in,))
    result = product_search(free_graph(), (10, 0), (10, 19), problem)
    assert result.states == 1
    assert not result.expanded[:, :10].any()


def test_the_product_of_many_automata_costs_nothing_that_is_not_entered():
    regions = tuple(box((20, 20), 2 * x, 2 * x, 15, 15) for x in range(10))
    counted = tuple(automata.entries(x, x, 0, 3) for x in range(10))
    result = product_search(free_graph(), (0, 0), (19, 0), ProductProblem(regions, counted))
    assert result.length == 19
    assert result.states < 10


def long_problem():
    """Regions in the corners of an open map that prices make hard: seconds of search."""
    size = 400
    random = np.random.default_rng(0)
    price = (random.random((size, size)) * 1e3).astype(np.float32)
    corners = [(0, 0), (size - 5, 0), (0, size - 5), (size - 5, size - 5)]
    regions = tuple(box((size, size), x, x + 4, y, y + 4) for x, y in corners)
    wanted = automata.visits([[0, 1, 2, 3]])
    return free_graph(size), ProductProblem(regions, (wanted,), price=price)


def test_a_deadline_that_has_passed_stops_the_search():
    graph, problem = long_problem()
    result = product_search(graph, (200, 200), (210, 200), problem, deadline=time.monotonic())
    assert result.status is SearchStatus.STOPPED
    assert len(result.path) == 0
    assert result.lower_bound < math.inf


def test_a_stop_flag_of_another_thread_ends_the_search():
    graph, problem = long_problem()
    stop = np.zeros(1, dtype=np.uint8)
    threading.Timer(0.02, stop.fill, (1,)).start()
    result = product_search(graph, (200, 200), (210, 200), problem, stop=stop)
    assert result.status is SearchStatus.STOPPED
    assert len(result.trace) == 0


def test_more_memory_than_the_limit_is_refused(monkeypatch):
    monkeypatch.setattr(product, 'MAX_BYTES', 4 * 9 * 400 * 400)
    graph, problem = long_problem()
    with pytest.raises(ProductTooLargeError, match='GB'):
        product_search(graph, (200, 200), (210, 200), problem)


def test_more_product_states_than_the_limit_are_refused(monkeypatch):
    monkeypatch.setattr(product, 'MAX_STATES', 20)
    # It counts the cells of the path, all of which are outside of regions.
    after = (np.arange(64, dtype=np.int16)[:, np.newaxis] + 1) % 64
    counter = Automaton((), after, np.arange(64) == 40)
    with pytest.raises(ProductTooLargeError, match='20 states'):
        product_search(free_graph(), (0, 0), (9, 9), ProductProblem((), (counter,)))


def test_problems_that_do_not_fit_the_grid_are_refused():
    graph, mask = free_graph(), box((20, 20), 0, 0, 0, 0)
    wanted = (automata.visits([[1]]),)
    bad = {
        'regions: 33': ProductProblem((mask,) * 33),
        r'regions\[1\]: shape': ProductProblem((mask, mask[1:])),
        'no region 1': ProductProblem((mask,), wanted),
        'automata: 65': ProductProblem((mask,) * 2, wanted * 65),
        'price: not all': ProductProblem(price=np.full((20, 20), math.nan, dtype=np.float32)),
        'goals: shape': ProductProblem(goals=np.zeros((2, 2), dtype=bool)),
    }
    for message, problem in bad.items():
        with pytest.raises(ProductProblemError, match=message):
            product_search(graph, (0, 0), (1, 1), problem)
