# Copyright 2026 The LLM-A* for ROS 2 contributors
# SPDX-License-Identifier: Apache-2.0

"""The one style of pictures, animations, reports and the page: colours, markers, names.

Plain constants without matplotlib, for a light background. Blue on amber stays apart for readers
who see few colours; every mark also has its own shape; and printed in grey the areas keep their
order of brightness: free, unknown, expanded, inflated, obstacle.
"""

from typing import NamedTuple


class Mark(NamedTuple):
    """A marked point: CSS colour, matplotlib's marker, its shape as a text, its name."""

    colour: str
    marker: str
    shape: str
    name: str


FREE, UNKNOWN, EXPANDED = '#ffffff', '#e9ebef', '#fcd98f'
# The free cells that the robot's radius, its footprint or the costmap's costs close.
INFLATED, OBSTACLE = '#a9aeb8', '#262a33'
# A path on its pale outline.
PATH, PATH_OUTLINE = '#0050b5', '#ffffff'
# A path that a bag holds, for comparison.
RECORDED = '#e07b00'
# Ways to choose from, one after the other.
WAYS = ('#e07b00', '#8e44ad', '#00838f', '#8c6d46')
# The robot's outline along a path.
FOOTPRINT = '#5c8fd6'

START = Mark('#56b4e9', 's', '■', 'start')
GOAL = Mark('#e0218a', 'D', '◆', 'goal')
VIA = Mark('#f0e442', '^', '▲', 'via point')
WAYPOINTS = {
    'accepted': Mark('#009e73', '*', '★', 'waypoint, accepted'),
    'unreachable': Mark('#8e44ad', 'v', '▼', 'waypoint, unreachable'),
    'occupied': Mark('#d55e00', 'X', '✖', 'waypoint, occupied'),
    'out_of_bounds': Mark('#7f7f7f', 'H', '⬢', 'waypoint, out of bounds'),
}
MARK_EDGE = '#111111'

# Clauses of an instruction, by `ClauseStatus`.
CLAUSES = {
    'KEPT': '#009e73', 'AS_FAR_AS_POSSIBLE': '#b8860b', 'NOT_KEPT': '#c8102e',
    'IMPOSSIBLE': '#c8102e', 'UNSURE': '#e08a00', 'NOT_UNDERSTOOD': '#7f7f7f',
    'UNSUPPORTED': '#7f7f7f',
}  # fmt: skip
# Where a path is not to be, and is not.
AVOIDED = '#b5533c'
# Named places.
AREA, OBJECT = '#00838f', '#8c6d46'

# Of pages and charts: text, less important text, lines, background of tables.
INK, SOFT, LINE, WASH = '#1f2430', '#5b6270', '#d9dce3', '#f4f5f8'
# Bars and curves: what is shown, and what it is compared with.
CHART, BASELINE = '#0050b5', '#9aa0ac'


def page_colours() -> dict[str, object]:
    """Return the colours by what is drawn, for JSON; `waypoint` has one for each status."""
    return {
        'free': FREE, 'obstacle': OBSTACLE, 'unknown': UNKNOWN, 'inflated': INFLATED,
        'expanded': EXPANDED, 'path': PATH, 'recorded': RECORDED, 'start': START.colour,
        'goal': GOAL.colour, 'via': VIA.colour, 'footprint': FOOTPRINT,
        'waypoint': {status: mark.colour for status, mark in WAYPOINTS.items()},
        'avoided': AVOIDED, 'ways': WAYS, 'clause': dict(CLAUSES),
    }  # fmt: skip
