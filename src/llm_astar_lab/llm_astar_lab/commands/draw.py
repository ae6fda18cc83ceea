# Copyright 2026 The LLM-A* for ROS 2 contributors
# SPDX-License-Identifier: Apache-2.0

"""Draw what A* and another method expand on the way from start to goal, side by side.

The file is a picture (.png, .svg, .pdf) or an animation (.gif).

usage: llm-astar draw [--map FILE] [--start X Y --goal X Y] [--method NAME] [--source NAME]
                      [options] --out FILE

examples:
  llm-astar draw --map-id 5 --pair 3 --out out/searches.gif
  llm-astar draw --method llm_astar --source oracle --out out/paper.png
  llm-astar draw --map depot.yaml --start -4.1 -4.8 --goal 17.9 4.7 --robot-radius 0.2
    --out out/depot.gif

exit codes: 0 drawn, 1 no path, 2 bad usage or input
"""

import argparse
from dataclasses import replace

from llm_astar_planner.cli.flags import ANIMATIONS, option, picture_or_animation
from llm_astar_planner.cli.planning_options import Problem, add_query_options, read_problem
from llm_astar_planner.parameter import ParameterError
from llm_astar_planner.planning.compile import compile_progress
from llm_astar_planner.planning.types import Plan, PlanRequest
from llm_astar_planner.resources import SAMPLES_FILE
from llm_astar_planner.waypoints.async_query import query_source
from llm_astar_planner.waypoints.source import WaypointQuery

from llm_astar_lab.pictures.retrace import retrace
from llm_astar_lab.runner.engine import AnsweredSource

ASTAR = 'astar'
Drawn = tuple[PlanRequest, Plan]


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the options: those of `plan`, and the file."""
    add_query_options(parser, SAMPLES_FILE)
    text = 'picture (.png, .svg, .pdf) or animation (.gif), by its ending'
    option(parser, '--out --png FILE', text, required=True, type=picture_or_animation)


def run(arguments: argparse.Namespace) -> int:
    """Draw; return 0, or 1 where there is no path. Raises what `plan` does on bad input."""
    asked = read_problem(arguments)
    if asked.request.instruction is not None:
        raise ParameterError('--instruction: A* keeps to none; `llm-astar plan --png` draws one')
    asked.planner.prepare()
    drawn = plan_beside_astar(asked)
    failed = next((plan for _, plan in drawn if plan.code), None)
    if failed is not None:
        print(f'no path: {failed.message} [{failed.code.name} {int(failed.code)}]')
        return 1
    write_drawing(asked, drawn, arguments.out)
    print(arguments.out)
    return 0


def plan_beside_astar(asked: Problem) -> list[Drawn]:
    """Plan with A*, and with the method and its waypoints unless that is A* too."""
    plain = replace(asked.request, method=ASTAR, source=None)
    requests = [plain] if asked.request.method == ASTAR else [plain, with_answer(asked)]
    drawn = []
    for request in requests:
        with compile_progress():
            asked.planner.compile(request)
        drawn.append((request, asked.planner.plan(request)))
    return drawn


def with_answer(asked: Problem) -> PlanRequest:
    """Return the request with the source's answer in its place.

    The search then has the waypoints from its beginning, so that it can be animated.
    """
    request = asked.request
    if request.source is None or request.via:
        return request
    ends, limit = (request.start, request.goal), request.source_time_limit
    query = WaypointQuery(asked.planner.costmap, *ends, limit, request.sample)
    reply, _ = query_source(request.source, query)
    return replace(request, source=AnsweredSource(request.source.name, reply))


def write_drawing(asked: Problem, drawn: list[Drawn], path: str) -> None:
    """Draw or animate the plans. Raises OSError, ParameterError where that cannot be done."""
    # Importing matplotlib takes most of a second, which bad usage should not wait for.
    from llm_astar_lab.pictures import animation, figures  # noqa: PLC0415

    planner, is_animated = asked.planner, path.lower().endswith(ANIMATIONS)
    pictures, searches = [], []
    for request, plan in drawn:
        name, costmap = figures.describe_plan(plan), planner.costmap
        picture = figures.picture_of_one(plan, costmap, asked.coordinates.offset, name)
        pictures.append(picture)
        if not is_animated:
            continue
        if order := retrace(planner, request, plan):
            outcome = figures.describe_length(plan, costmap.grid_map.resolution)
            searches.append(animation.AnimatedSearch(picture, order, name, outcome))
        else:
            why = 'for it is a plug-in, or its search depended on time'
            fix = 'draw a .png, or give it a higher --time-limit'
            what = f'in which order {plan.method} expanded the cells is not known, {why}'
            raise ParameterError(f'{path}: {what}; {fix}')
    if is_animated:
        animation.save_animation(path, searches)
    else:
        figures.write_figure(figures.comparison_figure(pictures), path)
