import os

import pytest

from benchmarks import live_graph
from benchmarks.live_graph import Answer, Usage


class Publisher:
    """Takes messages."""

    def __init__(self):
        self.messages = []

    def publish(self, message):
        self.messages.append(message)


def test_the_world_knows_which_map_is_the_newest():
    world, publisher = live_graph.make_world(120), Publisher()
    turns = world.turns()
    for _ in range(3):
        world.show(publisher, next(turns))
    assert world.published == len(publisher.messages) == 3
    assert world.received == 0
    world.receive(publisher.messages[1])
    assert world.received == 2
    assert [world.shown[digest] for digest in world.digests[:3]] == [1, 2, 3]
    assert len(set(world.digests)) == live_graph.DISTINCT_MAPS
    assert len(world.queries) == live_graph.QUERIES
    shown = [next(turns)[0] for _ in range(2 * live_graph.DISTINCT_MAPS - 5)]
    assert [*shown[-2:], next(turns)[0]] == [*world.digests[2:0:-1], world.digests[0]]


def test_what_is_printed_follows_from_what_was_measured(capsys):
    live_graph.print_answers([Answer(0.0, 0.010, 9, 9, 8), Answer(0.1, 0.030, 8, 9, 8)])
    live_graph.print_usage('node', [Usage(1.0, 5, 2**20), Usage(2.0, 4, 2**21)], 10.0)
    printed = capsys.readouterr().out
    assert '2 answers; of 50.0 % the map was the newest published' in printed
    assert 'of 100.0 % the newest received; 0.50 maps behind on average' in printed
    assert 'median 20 ms' in printed
    assert 'node: 10 % of a core; threads 5 to 4, at most 5; 1 to 2 MiB, at most 2' in printed


def test_the_usage_of_a_process_is_read():
    usage = Usage.of(os.getpid())
    assert usage.cpu > 0.0
    assert usage.threads >= 1
    assert usage.memory > 2**20


def test_an_unknown_option_is_refused():
    with pytest.raises(SystemExit):
        live_graph.main(['--nothing'])
