"""Ask a running planner_node for a plan, as another stack would, or what an instruction means.

examples:
  llm-astar call --start 2 3 --goal 20 5 --png plan.png
  llm-astar call --start 2 3 --to kitchen --instruction "avoid the lab"
  llm-astar call --interpret "visit the dock, then the workshop"

exit codes: 0 a path (or what was understood), 1 no path, 2 bad usage, or no answer in time
"""

from __future__ import annotations

import argparse
import json
import time
from dataclasses import asdict
from typing import TYPE_CHECKING, Any

from llm_astar_msgs_adapter.maps.grid_map import Pose2D

from llm_astar_planner.cli import flags
from llm_astar_planner.extensions import find_drawing
from llm_astar_planner.parameter import ParameterError

if TYPE_CHECKING:
    from llm_astar_planner.nodes.tools.planner_client import PlannerCaller

# Seconds in which the planner discovers the subscriber of its expanded cells.
DISCOVERY_SECONDS = 0.5


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the options."""
    flags.option(parser, '--start', 'start here, in metres of the frame of --frame', **flags.POINT)
    goal = parser.add_mutually_exclusive_group()
    flags.option(goal, '--goal', 'go here, in the same unit', **flags.POINT)
    flags.option(goal, '--to NAME', 'go to a place instead, one of those that the planner knows')
    flags.option(goal, '--interpret TEXT', 'only print what an instruction means to the planner')
    text = 'set the instruction of the planner first; empty: none any more'
    flags.option(parser, '--instruction TEXT', text)
    flags.option(parser, '--frame', 'frame of the poses (default: %(default)s)', default='map')
    flags.add_graph_options(parser)
    flags.add_time_limit(parser, 30.0)
    flags.option(parser, '--json', 'print one JSON object')
    flags.add_picture_option(parser, 'draw map and path')
    text = "the map of the picture, such as /global_costmap/costmap (default: 'map')"
    flags.option(parser, '--map-topic NAME', text, default='map')


def run(arguments: argparse.Namespace) -> int:
    """Call; return 0 for an answer, 1 for no path. Raises PlannerClientError, ParameterError."""
    ends = (arguments.start, arguments.to if arguments.goal is None else arguments.goal)
    if arguments.interpret is None and None in ends:
        raise ParameterError('--start and one of --goal and --to, or --interpret, are expected')
    flags.check_time_limit(arguments.time_limit)
    drawing = find_drawing('call') if arguments.png else None
    from llm_astar_planner.nodes.tools.planner_client import calling  # noqa: PLC0415
    from llm_astar_planner.planning.types import report_lines  # noqa: PLC0415

    with calling(arguments.namespace, arguments.node, arguments.time_limit) as caller:
        view = None
        if drawing is not None:
            # It listens to what the picture shows before the plan is made.
            view = drawing.load()(caller, caller.planner, arguments.map_topic)
            time.sleep(DISCOVERY_SECONDS)
        if arguments.instruction is not None:
            caller.set_instruction(arguments.instruction)
        if arguments.interpret is not None:
            return print_interpretation(caller, arguments.interpret, as_json=arguments.json)
        if arguments.instruction:
            for _ in caller.interpretations(arguments.instruction):
                pass  # the last answer is the one that plans are made with
        goal = caller.place(arguments.to) if arguments.to else Pose2D(*arguments.goal)
        start = Pose2D(*arguments.start)
        plan = caller.plan(start, goal, arguments.frame)
        if view is not None:
            view.draw(plan, (start, goal), arguments)
    if arguments.json:
        report = asdict(plan.report)
        print(json.dumps({'path': plan.points, 'seconds': plan.seconds, 'report': report}))
    else:
        print(*report_lines(plan.report, (start, goal), len(plan.points), plan.seconds), sep='\n')
        if arguments.png:
            print(f'picture    {arguments.png}')
    return 0 if plan.points else 1


def print_interpretation(caller: PlannerCaller, text: str, *, as_json: bool) -> int:
    """Print what a text means, each answer as it comes; return 0, or 2 where it was refused."""
    from llm_astar_planner.planning.types import interpretation_line  # noqa: PLC0415

    answer: dict[str, Any] = {}
    for answer in caller.interpretations(text):
        text = f'refused: {answer["error"]}' if answer.get('error') else ''
        print(json.dumps(answer) if as_json else text or interpretation_line(answer), flush=True)
    return 2 if answer.get('error') else 0
