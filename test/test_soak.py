"""Many callers for long, while maps change in size and place, the clock jumps, and nodes die.

`python -m pytest -m slow test/test_soak.py` runs the long one: 100,000 calls.
"""

import contextlib
import itertools
import random
import signal
import threading
import time
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, field, replace
from pathlib import Path as FilePath

import numpy as np
import pytest
import rclpy
from graph_tools import calling, process
from llm_astar_msgs_adapter.maps.barrier_map import load_barrier_maps
from llm_astar_msgs_adapter.maps.grid_map import Pose2D
from llm_astar_msgs_adapter.messages.fields import path_from_message
from llm_astar_msgs_adapter.messages.writing import grid_to_message
from llm_astar_planner.costmap.config import CostmapConfig
from llm_astar_planner.nodes.common.entities import LATCHED
from llm_astar_planner.nodes.tools.planner_client import PlannerClientError
from llm_astar_planner.planning.planner import Planner
from llm_astar_planner.resources import find_file
from nav_msgs.msg import OccupancyGrid
from rosgraph_msgs.msg import Clock
from tqdm import tqdm

NAMESPACE = '/soak'
CALLERS = 8
# Of the maps, one after the other: their sizes change.
SCALES = (1, 3, 2)
# And their places, in the other order.
ORIGINS = (Pose2D(-0.5, -0.5), Pose2D(1.5, -2.5, 0.1))
# Answers that a caller can tell from the map and the poses alone.
REFUSALS = {
    'START_OUTSIDE_MAP', 'GOAL_OUTSIDE_MAP', 'START_OCCUPIED', 'GOAL_OCCUPIED', 'NO_VALID_PATH',
}  # fmt: skip
MOST_GROWTH = {'bytes': 64 * 2**20, 'threads': 12, 'descriptors': 12, 'shared files': 12}
SETTINGS = [
    option
    for setting in (
        'tolerance:=0.0',
        'corner_cutting:=true',
        'search_while_waiting:=false',
        'source_timeout:=0.2',
        'use_sim_time:=true',
    )
    for option in ('-p', setting)
]


@pytest.fixture(autouse=True)
def _context():
    rclpy.init()
    yield
    rclpy.try_shutdown()


@dataclass
class PlanStatistics:
    """What the callers saw; each entry of `wrong` is a sentence."""

    guided: int = 0
    unguided: int = 0
    refused: int = 0
    unanswered: int = 0  # because the planner was killed
    wrong: list = field(default_factory=list)
    digests: set = field(default_factory=set)
    used: tuple = ()

    def fail(self, sentence):
        """Note what should not be, and say it at once: the rest may take an hour."""
        self.wrong.append(sentence)
        tqdm.write(f'{time.strftime("%H:%M:%S")} {sentence}')


def test_calls_survive_changing_maps_and_a_dying_client():
    tally = soak(rounds=5, calls_a_round=64)
    assert tally.wrong == []
    assert min(tally.guided, tally.unguided, tally.refused) > 0
    assert len(tally.digests) >= 3


@pytest.mark.slow
@pytest.mark.timeout(7200)
def test_a_hundred_thousand_calls():
    # A caller whose call was unanswered makes no more in that round.
    tally = soak(rounds=200, calls_a_round=512, killed=(30, 60, 90))
    assert tally.wrong == []
    assert tally.guided + tally.unguided + tally.refused >= 100_000
    assert min(tally.guided, tally.unguided, tally.refused) > 1000
    assert tally.unanswered <= 3 * CALLERS
    tqdm.write(str(replace(tally, digests=len(tally.digests))))


def soak(rounds, calls_a_round, killed=()):
    """Call in rounds from all callers at once, while map and clock change five times a second.

    The waypoint client comes before every fourth round, is stopped for the second and is killed in
    the third. In the rounds of `killed` the planner is killed, and started again after it.
    """
    maps = load_barrier_maps(find_file('samples_1000.json', 'maps'))
    changes = zip(maps, itertools.cycle(SCALES), itertools.cycle(ORIGINS))
    planners = {
        planner.grid_map.digest: planner for planner in itertools.starmap(planner_of, changes)
    }
    tally, used = PlanStatistics(), []
    with ThreadPoolExecutor(CALLERS + 1) as threads, contextlib.ExitStack() as stack:
        node_of_now, client = (stack.enter_context(contextlib.ExitStack()) for _ in range(2))
        node = node_of_now.enter_context(planner_node())
        callers = [stack.enter_context(calling(NAMESPACE, f'caller_{i}')) for i in range(CALLERS)]
        is_over = threading.Event()
        stack.callback(is_over.set)
        showing = threads.submit(publish_maps_and_times, callers[0].node, planners, is_over)
        wait_until_ready(callers)
        for turn in tqdm(range(rounds), disable=rounds < 100):
            if turn % 4 == 0:
                process_client = client.enter_context(waypoint_client())
                wait_for_client(callers[0])
            answers = [
                threads.submit(
                    call_on,
                    caller,
                    planners,
                    tally,
                    calls_a_round // CALLERS,
                    turn,
                    may_be_unanswered=turn in killed,
                )
                for caller in callers
            ]
            if turn % 4 == 1:
                process_client.send_signal(signal.SIGSTOP)
            if turn % 4 == 2:
                process_client.kill()
                client.close()
            if turn in killed:
                time.sleep(1.0)
                node.kill()
            for answer in answers:
                answer.result()
            if turn % 4 == 1:
                process_client.send_signal(signal.SIGCONT)
            if turn in killed:
                node_of_now.close()
                node = node_of_now.enter_context(planner_node())
                wait_until_ready(callers)
            used.append(usage(node.pid))
        is_over.set()
        showing.result()
        assert node.poll() is None, ''.join(node.output)
    half = used[len(used) // 2 :]
    for name, most in MOST_GROWTH.items():
        first, last = half[0][name], half[-1][name]
        if last - first > most:
            tally.fail(f'{name} grew from {first} to {last}')
    tally.used = half[0], half[-1]
    return tally


def planner_of(barrier_map, scale, origin):
    grid_map = replace(barrier_map.scale(scale).to_grid(), origin=origin)
    return Planner(grid_map, CostmapConfig(corner_cutting=True))


def planner_node():
    return process('planner_node', *SETTINGS, namespace=NAMESPACE)


def publish_maps_and_times(node, planners, is_over):
    """Publish another map and another time five times a second; the time jumps back and forth."""
    draw = random.Random(7)  # noqa: S311 - no secret
    maps = node.create_publisher(OccupancyGrid, 'map', LATCHED)
    clock = node.create_publisher(Clock, '/clock', LATCHED)
    for planner in itertools.cycle(planners.values()):
        seconds = draw.randrange(1_000, 1_000_000)
        now = Clock()
        now.clock.sec = seconds
        clock.publish(now)
        maps.publish(grid_to_message(planner.grid_map, now.clock))
        if is_over.wait(0.2):
            return


def waypoint_client():
    return process('llm_client_node', '-p', 'source:=straight', namespace=NAMESPACE)


def wait_until_ready(callers):
    """Wait until each caller sees the planner and that it has a map."""
    for caller in callers:
        caller.wait_until_ready()


def wait_for_client(caller):
    """Wait until the planner sees the client; a node just killed may be in the way for 20 s."""
    try:
        caller.wait_until_ready(client='llm_client_node')
    except PlannerClientError:
        caller.wait_until_ready(client='llm_client_node')


def call_on(caller, planners, tally, count, seed, *, may_be_unanswered):
    """Call with random poses, on the map and off it, and check what comes back."""
    draw = random.Random(f'{seed} {caller.node.get_name()}')  # noqa: S311 - no secret
    for _ in range(count):
        start, goal = (
            Pose2D(draw.uniform(-2.0, 53.0), draw.uniform(-2.0, 33.0)) for _ in range(2)
        )
        try:
            path, report, _ = caller.call(start, goal)
        except PlannerClientError as error:
            if may_be_unanswered:
                tally.unanswered += 1
                return
            tally.fail(f'{start} to {goal}: {error}')
            continue
        planner = planners.get(report.map_digest)
        if planner is None:
            tally.fail(f'{start} to {goal}: on no map: {report.summary}')
            continue
        note(planner, tally, start, goal, path, report)


def note(planner, tally, start, goal, path, report):
    """Check one answer against the map that its report names."""
    grid_map = planner.grid_map
    ends = [grid_map.world_to_cell(place.x, place.y) for place in (start, goal)]
    tally.digests.add(grid_map.digest)
    cells = grid_map.world_to_cells(path_from_message(path)).astype(np.int32)
    # The exact start and goal may lie in one cell with the pose next to them.
    cells = cells[np.any(np.diff(cells, axis=0, prepend=-1), axis=1)]
    problem = planner.checker.path_problem(cells, *ends)
    if report.code == 0 and problem is None:
        tally.guided += report.guided_by != 'none'
        tally.unguided += report.guided_by == 'none'
    elif report.code_name in REFUSALS and len(cells) == 0 and is_refusal(planner, *ends):
        tally.refused += 1
    else:
        tally.fail(f'{start} to {goal} on {grid_map.digest}: {report.summary}; {problem}')


def is_refusal(planner, start, goal):
    """Tell whether no path can exist."""
    if not all(planner.grid_map.contains(cell) for cell in (start, goal)):
        return True
    places = [planner.costmap.components[y, x] for x, y in (start, goal)]
    return places[0] != places[1] or 0 in places


def usage(pid):
    """Return what a process uses: memory, threads, descriptors; and all files in shared memory."""
    lines = FilePath(f'/proc/{pid}/status').read_text().splitlines()
    fields = dict(line.split(':', 1) for line in lines)
    return {
        'bytes': int(fields['VmRSS'].split()[0]) * 1024,
        'threads': int(fields['Threads']),
        'descriptors': len(list(FilePath(f'/proc/{pid}/fd').iterdir())),
        # Those of our own domain: others come and go.
        'shared files': len(own_shared_files(pid)),
    }


def own_shared_files(pid):
    """Return the files in /dev/shm that a process has mapped."""
    maps = FilePath(f'/proc/{pid}/maps').read_text().splitlines()
    return {line.split()[-1] for line in maps if '/dev/shm/' in line}  # noqa: S108
