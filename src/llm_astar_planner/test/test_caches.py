"""Memories of a bounded size."""

import threading
import time

from llm_astar_planner.caches import Recent, cached


def test_what_was_not_used_for_longest_makes_way():
    known = Recent(2)
    known['a'], known['b'] = 1, 2
    assert known.get('a') == 1
    known['c'] = 3
    assert dict(known) == {'a': 1, 'c': 3}
    known['a'] = 4
    known['d'] = 5
    assert dict(known) == {'a': 4, 'd': 5}


def test_asking_for_what_is_not_there_changes_nothing():
    known = Recent(2)
    assert known.get('a') is None
    assert known.get('a', 7) == 7
    assert not known


def test_what_is_taken_out_makes_room():
    known = Recent(2)
    known['a'], known['b'] = 1, 2
    assert known.pop('a') == 1
    known['c'] = 3
    assert list(known.items()) == [('b', 2), ('c', 3)]


def test_many_entries_set_at_once_keep_to_the_size():
    known = Recent(3)
    known.update({number: str(number) for number in range(10)})
    assert list(known) == [7, 8, 9]


def test_entries_may_cost_more_than_one_and_the_newest_is_always_kept():
    known = Recent(10, cost=len)
    known['a'], known['b'] = 'x' * 6, 'x' * 4
    assert len(known) == 2
    known['c'] = 'x' * 5
    assert list(known) == ['b', 'c']
    known['d'] = 'x' * 50
    assert list(known) == ['d']


def test_a_result_is_computed_once_for_each_key():
    asked = []

    @cached(2, key=lambda text: text.lower())
    def length(text):
        """Say how long a text is."""
        asked.append(text)
        return len(text)

    assert [length(text) for text in ('one', 'ONE', 'three', 'One')] == [3, 3, 5, 3]
    assert asked == ['one', 'three']
    assert length.__doc__ == 'Say how long a text is.'


def test_two_threads_get_the_same_result():
    @cached(2, key=lambda name: name)
    def made(name):
        time.sleep(0.05)
        return [name]

    found = []
    threads = [threading.Thread(target=lambda: found.append(made('a'))) for _ in range(4)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert all(one is found[0] for one in found)
