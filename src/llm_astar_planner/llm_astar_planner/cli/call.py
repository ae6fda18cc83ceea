# Copyright 2026 The LLM-A* for ROS 2 contributors
# SPDX-License-Identifier: Apache-2.0

"""Ask a running planner_node for a plan, as another stack would, or what an instruction means.

examples:
  llm-astar call --start 2 3 --goal 20 5 --png plan.png
  llm-astar call --from dock --to kitchen --instruction "avoid the lab"
  llm-astar call --interpret "visit the dock, then the workshop"

exit codes: 0 a path (or what was understood), 1 no path, 2 bad usage, or no answer in time, 3 a
path that does not keep the instruction. After 1 and 2 the planner's instruction and places are
what they were.
"""

from __future__ import annotations

import argparse
import json
import sys
import time
from collections.abc import Callable
from contextlib import ExitStack
from dataclasses import asdict
from typing import TYPE_CHECKING, Any

from llm_astar_planner.cli import flags
from llm_astar_planner.parameter import ParameterError
from llm_astar_planner.plugins import find_drawing
from llm_astar_planner.resources import find_file

if TYPE_CHECKING:
    from llm_astar_planner.nodes.tools.planner_client import PlannerCaller

# A point in metres, or the name of a place.
Where = str | list[float]
# Seconds in which the planner discovers the subscriber of its expanded cells.
DISCOVERY_SECONDS = 0.5


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the options."""
    start = parser.add_mutually_exclusive_group()
    text = 'start here, in metres of the frame of --frame'
    flags.option(start, '--start', text, **flags.POINT)
    text = 'start at a place or a point'
    flags.option(start, '--from NAME|X,Y', text, dest='start_place')
    goal = parser.add_mutually_exclusive_group()
    flags.option(goal, '--goal', 'go here, in the same unit', **flags.POINT)
    flags.option(goal, '--to NAME|X,Y', 'go to a place, one of those that the planner knows')
    flags.option(goal, '--interpret TEXT', 'only print what an instruction means to the planner')
    text = 'set the instruction of the planner, if there is a path; empty: none any more'
    flags.option(parser, '--instruction TEXT', text)
    flags.option(parser, '--confirm', 'take what is unsure of it as it was read')
    text = 'set the places of the planner, if there is a path: a GeoJSON file that it can read'
    flags.option(parser, '--places FILE', text, dest='places_file')
    flags.option(parser, '--frame', 'frame of the poses (default: %(default)s)', default='map')
    flags.add_graph_options(parser)
    flags.add_time_limit(parser, 30.0)
    flags.option(parser, '--json', 'print one JSON object')
    flags.add_picture_option(parser, 'draw map and path')
    text = "the map of the picture, such as /global_costmap/costmap (default: 'map')"
    flags.option(parser, '--map-topic NAME', text, default='map')


def run(arguments: argparse.Namespace) -> int:
    """Call; return 0 for an answer, 1 for no path, 3 where the instruction is not kept.

    Without an answer the planner's instruction and places are set back to what they were. Raises
    PlannerClientError, ParameterError.
    """
    start = arguments.start_place if arguments.start is None else arguments.start
    goal = arguments.to if arguments.goal is None else arguments.goal
    if arguments.interpret is None and None in (start, goal):
        raise ParameterError(
            'one of --start and --from, and one of --goal and --to, or --interpret, are expected'
        )
    drawing = find_drawing('call') if arguments.png else None
    given = {name: getattr(arguments, name) for name in ('places_file', 'instruction')}
    given = {name: value for name, value in given.items() if value is not None}
    if arguments.places_file:
        given['places_file'] = str(find_file(arguments.places_file, 'maps').resolve())
    from llm_astar_planner.nodes.tools.planner_client import calling  # noqa: PLC0415

    with calling(arguments.namespace, arguments.node, arguments.time_limit) as caller:
        draw = None
        if drawing is not None:
            # It listens to what the picture shows before the plan is made.
            draw = drawing.load()(caller, caller.planner, arguments.map_topic).draw
            time.sleep(DISCOVERY_SECONDS)
        with ExitStack() as undo:
            if given:
                undo.callback(caller.set_values, caller.values([*given]))
                caller.set_values(given)
            if arguments.interpret is None:
                code = print_plan(caller, arguments, (start, goal), draw)
            else:
                code = print_interpretation(caller, arguments.interpret, as_json=arguments.json)
            if code in (0, 3):
                undo.pop_all()
            return code


def print_plan(
    caller: PlannerCaller,
    arguments: argparse.Namespace,
    ends: tuple[Where, Where],
    draw: Callable[..., None] | None,
) -> int:
    """Ask for a plan, print and draw it; return the exit code."""
    from llm_astar_planner.cli.map_files import open_places  # noqa: PLC0415
    from llm_astar_planner.planning.report import report_lines  # noqa: PLC0415

    text = arguments.instruction or ''
    if arguments.confirm and not text:
        text = caller.values(['instruction'])['instruction']
    # The last answer is the one that plans are made with.
    *_, reading = caller.interpretations(text) if text else ({},)
    questions = reading.get('questions')
    if questions:
        answer = arguments.confirm or flags.ask_person(questions)
        if answer is None:
            sys.stderr.write(flags.CONFIRM_HINT)
        else:
            caller.confirm(text, is_meant=answer)
    places = open_places(arguments.places_file, None) if arguments.places_file else None
    start, goal = (caller.pose(end, places) for end in ends)
    plan = caller.call(start, goal, arguments.frame, caller.seconds)
    if draw is not None:
        draw(plan, (start, goal), arguments)
    if arguments.json:
        report = asdict(plan.report)
        print(json.dumps({'path': plan.points, 'seconds': plan.seconds, 'report': report}))
    else:
        print(*report_lines(plan.report, (start, goal), len(plan.points), plan.seconds), sep='\n')
        if arguments.png:
            print(f'picture    {arguments.png}')
    if not plan.points:
        return 1
    return 3 if (plan.report.instruction_report or {}).get('satisfied') is False else 0


def print_interpretation(caller: PlannerCaller, text: str, *, as_json: bool) -> int:
    """Print what a text means, each answer as it comes; return 0, or 2 where it was refused."""
    from llm_astar_planner.planning.report import interpretation_line  # noqa: PLC0415

    answer: dict[str, Any] = {}
    for answer in caller.interpretations(text):
        text = f'refused: {answer["error"]}' if answer.get('error') else ''
        print(json.dumps(answer) if as_json else text or interpretation_line(answer), flush=True)
    return 2 if answer.get('error') else 0
