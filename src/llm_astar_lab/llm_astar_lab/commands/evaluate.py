# Copyright 2026 The LLM-A* for ROS 2 contributors
# SPDX-License-Identifier: Apache-2.0

"""Plan every request in rosbag2 bags (mcap or sqlite3) with every method and source.

Compare with the recorded plans, and write a results folder like that of bench. No robot, graph
or display is needed.

usage: llm-astar evaluate BAG [BAG ...] [--list] [--methods NAMES] [--source NAMES]
                          [--params-file FILE] [--out DIR] [--fail-under LIMIT] [options]

examples:
  llm-astar evaluate bag --list                       what the bag contains
  llm-astar evaluate bag --methods guided,exact_astar --params-file planner.yaml
  llm-astar evaluate monday tuesday.mcap --source replay --out out/field
  llm-astar evaluate bag --methods guided --fail-under guided:valid=100    gate a release

Every request is planned on the map of its time. --source replay without --transcript uses the
exchanges with models that the bags contain.

exit codes: 0 ok, 1 threshold missed, 2 bad usage or input, 3 something was left out or a source
did not answer, 130 interrupted
"""

import argparse
import json
from collections.abc import Sequence
from dataclasses import asdict, replace
from pathlib import Path
from typing import Any

from llm_astar_msgs_adapter.maps.problem_maps import format_kept_maps
from llm_astar_planner.cli import flags
from llm_astar_planner.cli.map_files import open_places
from llm_astar_planner.planning import parameters
from llm_astar_planner.planning.parameters import COSTMAP, REQUESTS

from llm_astar_lab.bags.reading import Bag, Problems, bag_name, open_bags
from llm_astar_lab.bags.types import BARRIER_MAP
from llm_astar_lab.commands import run_options as common
from llm_astar_lab.evaluation import requests as of_bags
from llm_astar_lab.evaluation.requests import REQUEST_KINDS, TopicSelection
from llm_astar_lab.evaluation.tasks import Evaluation
from llm_astar_lab.results.folder import MAPS_FILE, ResultsFolder, describe_run
from llm_astar_lab.results.row import ResultsError
from llm_astar_lab.runner.config import choose_folder
from llm_astar_lab.runner.engine import SearchSettings
from llm_astar_lab.runner.sources import GRID_BASELINES

# The parameters that have flags of their own; the search has the flags of `bench`.
OF_REQUESTS = flags.named(REQUESTS, 'tolerance', 'start_tolerance', 'robot_base_frame')
RULES = (*COSTMAP, *(item.for_bench() for item in OF_REQUESTS))
# The exchanges with models that were found in the bags, in the results folder.
EXCHANGES = 'exchanges.jsonl'


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the options."""
    parser.set_defaults(seed=0)
    flags.option(parser, 'bags BAG', 'a folder, or an mcap or db3 file', nargs='+')
    add_input(parser.add_argument_group('input'))
    common.add_variants(parser.add_argument_group('methods and sources'))
    rules = parser.add_argument_group('rules, by the names of the parameters of planner_node')
    flags.add_params_file_flag(rules)
    flags.add_parameter_flags(rules, RULES)
    common.add_instruction(
        parser.add_argument_group('an instruction for every request, instead of the recorded ones')
    )
    common.add_running(parser.add_argument_group('running'), 'out/evaluate')


def add_input(group: Any) -> None:  # noqa: ANN401 - argparse keeps its type private
    """Add the options that choose topics and requests."""
    flags.option(group, '--list', 'only show what the bags contain')
    flags.option(group, '--namespace NAME', "the robot's, where a bag has several", default='')
    flags.option(group, '--map-topic TOPIC', '(/map)', default='')
    flags.option(group, '--plan-topic TOPIC', "the robot's own plans (/plan)", default='')
    text = 'the start of goals, where tf does not join map and base_link (/odom)'
    flags.option(group, '--odom-topic TOPIC', text, default='')
    flags.option(
        group, '--requests WHAT',
        "service: calls of GetPlan; goals: goal_pose; plans: the robot's own paths, from "
        'first to last pose; auto: service and goals, or plans where there are neither (auto)',
        choices=REQUEST_KINDS, default='auto',
    )  # fmt: skip
    text = 'how long after a request its recorded plan may come (10)'
    flags.option(group, '--plan-window SECONDS', text, default=10.0, type=flags.at_least(0))


def run(args: argparse.Namespace) -> int:
    """Evaluate bags or list their contents; return the exit code. Raises ValueError."""
    namespace = args.namespace.strip('/')
    topics = (args.map_topic, args.plan_topic, args.odom_topic)
    selection = TopicSelection(f'/{namespace}' if namespace else '', *topics, args.requests)
    if args.list:
        return list_contents(args, selection)
    paths = args.params_file
    file = parameters.read_parameter_files(paths)['planner_node'] if paths else None
    common.settle_variants(args, file)
    in_file = {item.name: file[item.name] for item in RULES if file and item.name in file}
    rules = in_file | flags.given_values(args, RULES)
    folder = choose_folder(args.out, args.default_out, resume=args.resume)
    run = common.Run(args, folder, {})
    try:
        with open_bags(args.bags) as (bags, unopened):
            if not bags:
                return common.complain(args, '; '.join(unopened.lines()), common.BAD_INPUT)
            if 'replay' in args.source and not args.transcript:
                args.transcript = [str(save_exchanges(args, bags, selection, folder))]
            config = make_config(args, bags, selection, rules, folder=folder)
            common.check_thresholds(args, config.sources)
            kept = run_parameters(args, config)
            run.metadata |= describe_run(args.bags, kept, common.deciding_files(args))
            names = dict.fromkeys(bag_name(Path(path)) for path in args.bags)
            run.metadata['bags'] = list(names)
            run.execute(config.tasks(run.open()), config.sources, 'request')
            problems = [unopened, *(bag.problems for bag in bags)]
        report_problems(run, problems)
        folder.write_text(MAPS_FILE, format_kept_maps(config.kept_maps()))
        folder.write_places(config.places)
        return run.close()
    except ResultsError as error:
        return run.failed(error)


def report_problems(run: common.Run, problems: Sequence[Problems]) -> None:
    """Say and keep what was left out of the bags."""
    left_out = [line for one in problems for line in one.lines()]
    notes = [line for one in problems for line in one.notes]
    run.metadata |= {'left_out': left_out, 'notes': notes}
    for line in notes:
        run.complain(f'note: {line}', common.OK)
    for line in left_out:
        run.complain(f'left out: {line}', common.INCOMPLETE)


def list_contents(args: argparse.Namespace, selection: TopicSelection) -> int:
    """Show what bags contain; return 3 where one cannot be read or evaluated."""
    code = common.OK
    with open_bags(args.bags) as (bags, unopened):
        contents = [of_bags.describe(bag, selection) for bag in bags]
    for line in unopened.lines():
        code = common.complain(args, line, common.INCOMPLETE)
    if any(item['missing'] or item['left_out'] for item in contents):
        code = common.INCOMPLETE
    print(json.dumps(contents) if args.json else '\n'.join(map(of_bags.describe_text, contents)))
    return code


def save_exchanges(
    args: argparse.Namespace, bags: Sequence[Bag], selection: TopicSelection, folder: ResultsFolder
) -> Path:
    """Write the exchanges of the bags into the folder, as the transcript to replay.

    A resumed folder has it already. Raises ResultsError where the folder holds other results,
    ValueError where the bags have no exchanges.
    """
    transcript = folder.path / EXCHANGES
    if args.resume and folder.results.exists() and transcript.exists():
        return transcript
    if not (args.resume or args.overwrite):
        folder.require_new()
    if not of_bags.write_exchanges(bags, selection, transcript):
        raise ValueError(
            '--source replay: the bags hold no exchanges with a model (on ~/exchange of '
            'llm_client_node); name a --transcript'
        )
    return transcript


def make_config(
    args: argparse.Namespace,
    bags: Sequence[Bag],
    selection: TopicSelection,
    rules: dict[str, Any],
    *,
    folder: ResultsFolder,
) -> Evaluation:
    """Return what the evaluation covers.

    All baselines are added only where the barriers of every map are known.
    """
    values = parameters.defaults(RULES, cli=True) | rules
    places = open_places(args.places_file or '', None)
    tolerances = {name: values[name] for name in ('tolerance', 'start_tolerance')}
    request = common.search_request(args, places, **tolerances)
    is_paper = 'corner_cutting' not in rules and not args.params_file
    settings = SearchSettings(request, parameters.costmap_config(rules), is_paper)
    all_barriers = all(BARRIER_MAP in bag.topics for bag in bags)
    sources = common.source_specs(args, folder, (), None if all_barriers else GRID_BASELINES)
    selection = replace(selection, base_frame=values['robot_base_frame'])
    return Evaluation(bags, selection, args.methods, sources, settings, args.plan_window, places)


def run_parameters(args: argparse.Namespace, config: Evaluation) -> dict[str, Any]:
    """Return the parameters for the metadata of the run."""
    settings = config.settings
    return common.deciding_parameters(args, 'requests', 'plan_window') | {
        'rules': None if settings.costmap is None else asdict(settings.costmap),
        'tolerance': settings.request.tolerance,
        'start_tolerance': settings.request.start_tolerance,
        'paper_corners': settings.paper_corners, 'topics': list(asdict(config.selection).values()),
    }  # fmt: skip
