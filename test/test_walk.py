"""How much code answers one call: what a person has to read to know the way of a plan."""

import threading
from contextlib import contextmanager

import pytest
import rclpy
from graph_tools import GOAL, PATIENCE, START, calling, process, running
from llm_astar_planner.nodes.planner.planner_node import PlannerNode

SPACE = '/walk'
# What answers a call with waypoints may pass: a change that needs more says why.
MOST_FUNCTIONS, MOST_FILES, MOST_DEPTH = 90, 20, 13


@pytest.fixture(autouse=True)
def _context():
    rclpy.init()
    yield
    rclpy.try_shutdown()


@contextmanager
def profiled():
    """Give the calls and returns of our functions by thread, of threads that begin meanwhile."""
    events = {}

    def note(frame, event, _):
        code = frame.f_code
        if event in ('call', 'return') and '/llm_astar_' in code.co_filename:
            own = events.setdefault(threading.get_ident(), [])
            own.append((event, code.co_filename, code.co_qualname))

    threading.setprofile(note)
    try:
        yield events
    finally:
        threading.setprofile(None)


def walk(events):
    """Return the functions (file and name) that calls and returns go through, and the depth."""
    depth = deepest = 0
    for event, *_ in events:
        depth = depth + 1 if event == 'call' else max(0, depth - 1)
        deepest = max(deepest, depth)
    return {tuple(function) for _, *function in events}, deepest


def test_one_get_plan_with_waypoints_passes_few_functions_and_files():
    node = PlannerNode(namespace=SPACE)
    nodes = [process(name, namespace=SPACE, files=()) for name in ('map_node', 'llm_client_node')]
    with nodes[0], nodes[1], running(node), calling(SPACE) as caller:
        caller.wait_until_ready(client='llm_client_node')
        caller.wait_for_landmarks()
        # The first call imports and compiles, and on a busy machine waypoints come too late.
        with profiled() as calls:
            caller.call(START, GOAL, seconds=2 * PATIENCE)
            for row in range(15, 25):
                calls.clear()
                report = caller.call(START, GOAL._replace(y=float(row)))[1]
                if report.guided_by != 'none':
                    break
    assert report.code == 0
    functions, depth = max(map(walk, calls.values()), key=lambda walked: len(walked[0]))
    assert {'RequestHandler.answer', 'GuidedSearch.solutions'} <= {name for _, name in functions}
    files = {file for file, _ in functions}
    assert len(functions) <= MOST_FUNCTIONS, sorted(functions)
    assert (len(files) <= MOST_FILES, depth <= MOST_DEPTH) == (True, True), sorted(files)
