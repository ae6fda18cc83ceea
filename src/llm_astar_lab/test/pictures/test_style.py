"""The one style: complete, apart in grey, and importable without matplotlib."""

import json
import subprocess
import sys
from itertools import pairwise

from llm_astar_lab.pictures import style
from llm_astar_planner.instructions.outcome import ClauseStatus
from llm_astar_planner.planning.types import WaypointStatus


def grey(colour):
    red, green, blue = bytes.fromhex(colour[1:])
    return 0.299 * red + 0.587 * green + 0.114 * blue


def test_every_status_has_its_own_colour_and_shape():
    assert set(style.WAYPOINTS) == {status.value for status in WaypointStatus}
    assert set(style.CLAUSES) == {status.name for status in ClauseStatus}
    marks = [style.START, style.GOAL, style.VIA, *style.WAYPOINTS.values()]
    for field in ('colour', 'marker', 'shape', 'name'):
        assert len({getattr(mark, field) for mark in marks}) == len(marks)


def test_areas_differ_in_brightness_too():
    areas = (style.FREE, style.UNKNOWN, style.EXPANDED, style.INFLATED, style.OBSTACLE)
    shades = [grey(colour) for colour in areas]
    assert all(first - second > 12 for first, second in pairwise(shades))
    # The path stands out from whatever it may lie on.
    assert grey(style.INFLATED) - grey(style.PATH) > 90


def test_the_page_gets_its_colours_as_json_without_matplotlib():
    code = (
        'import sys, json; from llm_astar_lab.pictures import style; '
        'print(json.dumps(style.page_colours())); '
        'sys.exit(any(name in sys.modules for name in ("matplotlib", "numpy")))'
    )
    done = subprocess.run([sys.executable, '-c', code], capture_output=True, text=True, check=True)
    colours = json.loads(done.stdout)
    assert colours['path'] == style.PATH
    assert colours['waypoint']['occupied'] == style.WAYPOINTS['occupied'].colour
