"""No question is searched twice: callers at a time share one search, later ones the memory."""

import threading
import time
from dataclasses import replace

import numpy as np
import pytest
from llm_astar_msgs_adapter.maps.grid_map import GridMap
from llm_astar_planner.planning.plan_memory import REMEMBERED, SHARED, PlanMemory, is_settled
from llm_astar_planner.planning.planner import Planner
from llm_astar_planner.planning.recall import Recall
from llm_astar_planner.planning.types import PlanRequest, ResultCode
from llm_astar_planner.search.stop import no_stop
from llm_astar_planner.waypoints.source import SourceStatus, WaypointReply

LONG = 60.0
FREE = Planner(GridMap(np.zeros((20, 30), dtype=np.int8)))
REQUEST = PlanRequest((2, 2), (25, 15), max_suboptimality=1.1, want_expanded=False)


@pytest.fixture(scope='module')
def plan():
    return FREE.plan(REQUEST)


class Search:
    """A search that counts its runs, and lasts until it is let go."""

    def __init__(self, plan):
        self.plan = plan
        self.runs = 0
        self.began = threading.Event()
        self.go = threading.Event()

    def __call__(self):
        self.runs += 1
        self.began.set()
        assert self.go.wait(LONG)
        return self.plan


def ask(memory, search, stop=None, seconds=LONG, key='question', is_kept=lambda _: True):
    return memory.answer(key, search, no_stop() if stop is None else stop, seconds, is_kept)


def in_thread(answers, *arguments, **options):
    thread = threading.Thread(target=lambda: answers.append(ask(*arguments, **options)))
    thread.start()
    return thread


def test_the_same_question_is_answered_from_memory_and_costs_nothing(plan):
    memory, search = PlanMemory(4), Search(plan)
    search.go.set()
    first, how = ask(memory, search)
    again, how_again = ask(memory, search)
    assert (how, how_again) == ('', REMEMBERED)
    assert search.runs == 1
    assert again.path is first.path
    assert (again.seconds_source, again.seconds_search) == (0.0, 0.0)


def test_callers_at_a_time_share_one_search(plan):
    memory, search, answers = PlanMemory(0), Search(plan), []
    threads = [in_thread(answers, memory, search) for _ in range(4)]
    search.began.wait(LONG)
    search.go.set()
    for thread in threads:
        thread.join(LONG)
    assert search.runs <= 4 - sum(how == SHARED for _, how in answers)
    assert all(answer.path is plan.path for answer, _ in answers)


def test_a_memory_of_nothing_searches_each_time(plan):
    memory, search = PlanMemory(0), Search(plan)
    search.go.set()
    assert [ask(memory, search)[1] for _ in range(3)] == ['', '', '']
    assert search.runs == 3


def test_the_question_longest_not_asked_is_forgotten_first(plan):
    memory, search = PlanMemory(2), Search(plan)
    search.go.set()
    hows = [ask(memory, search, key=key)[1] for key in ('a', 'b', 'a', 'c', 'a', 'b')]
    assert hows == ['', '', REMEMBERED, '', REMEMBERED, '']
    memory.resize(0)
    assert ask(memory, search, key='a')[1] == ''


def test_what_is_not_worth_keeping_is_searched_again(plan):
    memory, search = PlanMemory(4), Search(plan)
    search.go.set()
    hows = [ask(memory, search, is_kept=lambda _: False)[1] for _ in range(2)]
    assert hows == ['', '']


def test_what_was_under_way_when_all_was_forgotten_is_not_remembered(plan):
    memory, search, answers = PlanMemory(4), Search(plan), []
    thread = in_thread(answers, memory, search)
    search.began.wait(LONG)
    memory.forget()
    search.go.set()
    thread.join(LONG)
    assert ask(memory, search)[1] == ''
    assert search.runs == 2


@pytest.mark.parametrize('why', ['stop', 'deadline'])
def test_one_who_waits_for_anothers_search_gives_up_alone(plan, why):
    memory, search, answers = PlanMemory(4), Search(plan), []
    thread = in_thread(answers, memory, search)
    search.began.wait(LONG)
    stop = no_stop()
    stop[0] = why == 'stop'
    began = time.monotonic()
    waited, _ = ask(memory, search, stop, LONG if why == 'stop' else 0.05)
    assert waited is None
    assert time.monotonic() - began < LONG / 2
    search.go.set()
    thread.join(LONG)
    assert answers[0][0].path is plan.path
    assert search.runs == 1


def test_where_the_one_who_searches_gives_up_another_takes_over(plan):
    memory, first, second, answers = PlanMemory(4), Search(plan), Search(plan), []
    stop = no_stop()
    leader = in_thread(answers, memory, first, stop)
    first.began.wait(LONG)
    follower = in_thread(answers, memory, second)
    stop[0] = 1
    first.go.set()
    second.go.set()
    leader.join(LONG)
    follower.join(LONG)
    assert (first.runs, second.runs) == (1, 1)
    assert ask(memory, second)[1] == REMEMBERED


def test_a_search_that_breaks_leaves_nobody_waiting(plan):
    memory = PlanMemory(4)

    def broken():
        raise RuntimeError('broken')

    with pytest.raises(RuntimeError):
        ask(memory, broken)
    search = Search(plan)
    search.go.set()
    assert ask(memory, search)[0].path is plan.path


@pytest.mark.parametrize(
    ('changes', 'request_changes', 'settled'),
    [
        ({}, {}, True),
        ({'reply': WaypointReply(status=SourceStatus.OK)}, {}, True),
        ({'reply': WaypointReply(status=SourceStatus.LATE)}, {}, False),
        ({'reply': WaypointReply(status=SourceStatus.TIMEOUT)}, {}, False),
        ({'code': ResultCode.NO_VALID_PATH}, {}, False),
        ({'ratio': 1.2}, {}, False),
        ({'ratio': 1.2}, {'max_suboptimality': None}, True),
        ({'ratio': float('nan')}, {}, True),
        ({}, {'want_expanded': True}, False),
        ({'instruction': 'followed through 1 via point'}, {}, True),
        ({'instruction': 'not honoured: out of time'}, {}, False),
    ],
)
def test_only_what_asking_again_could_not_better_is_kept(plan, changes, request_changes, settled):
    assert is_settled(replace(plan, **changes), replace(REQUEST, **request_changes)) == settled


def test_a_planner_with_a_memory_tells_maps_rules_and_settings_apart():
    recall = Recall(8)

    def how(planner=FREE, **changes):
        return recall.plan(planner, replace(REQUEST, **changes), LONG, no_stop())[1]

    walled = np.zeros((20, 30), dtype=np.int8)
    walled[5:, 12] = 100
    other = Planner(GridMap(walled))
    stricter = Planner(FREE.grid_map, replace(FREE.rules, occupied_threshold=50))
    assert [how(), how(), how(planner=other), how(planner=stricter)] == ['', REMEMBERED, '', '']
    assert [how(tolerance=0.3), how(method='astar'), how(instruction='south')] == ['', '', '']
    # The same map under another object is the same map.
    assert how(planner=Planner(GridMap(FREE.grid_map.cells.copy()))) == REMEMBERED
    recall.forget()
    assert how() == ''


class Slow:
    """A planner whose first search lasts until it is let go; keeps the time each search had."""

    def __init__(self, plan):
        self.grid_map, self.rules = FREE.grid_map, FREE.rules
        self.result = plan
        self.limits = []
        self.began, self.go = threading.Event(), threading.Event()

    def plan(self, request, *_):
        self.limits.append(request.time_limit)
        self.began.set()
        assert self.go.wait(LONG)
        return self.result


def test_time_spent_waiting_for_anothers_search_is_not_had_again(plan):
    recall, planner, stop, asked = Recall(4), Slow(plan), no_stop(), threading.Event()

    def follow():
        asked.set()
        recall.plan(planner, REQUEST, LONG, no_stop())

    leader = threading.Thread(target=lambda: recall.plan(planner, REQUEST, LONG, stop))
    follower = threading.Thread(target=follow)
    leader.start()
    planner.began.wait(LONG)
    follower.start()
    asked.wait(LONG)
    time.sleep(0.3)
    stop[0] = 1
    planner.go.set()
    leader.join(LONG)
    follower.join(LONG)
    assert planner.limits[1] < LONG - 0.05
