"""`llm-astar evaluate`: the planner over recorded bags, without a robot, a graph or a screen."""

from __future__ import annotations

import argparse
import json
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager, nullcontext
from dataclasses import asdict, replace
from pathlib import Path
from typing import Any

from llm_astar_msgs_adapter.bags.files import bag_name
from llm_astar_msgs_adapter.bags.messages import BARRIER_MAP
from llm_astar_msgs_adapter.bags.reading import Bag, open_bags
from llm_astar_msgs_adapter.bags.writing import BagWriteError

from llm_astar_planner.benchmark.bags.exchanges import write_exchanges
from llm_astar_planner.benchmark.bags.requests import ListedRequest
from llm_astar_planner.benchmark.bags.tasks import BagTasks, EvaluationConfig
from llm_astar_planner.benchmark.bags.topics import TopicSelection, describe, describe_text
from llm_astar_planner.benchmark.bags.writing import ResultsBag
from llm_astar_planner.benchmark.datasets.samples import ProblemMap, save_kept_maps
from llm_astar_planner.benchmark.results import (
    MAPS_FILE,
    ResultsError,
    ResultsFolder,
    describe_run,
)
from llm_astar_planner.benchmark.runner.config import open_folder, run_into_folder
from llm_astar_planner.benchmark.runner.engine import Outcome, SearchSettings, Task
from llm_astar_planner.benchmark.runner.progress import progress
from llm_astar_planner.benchmark.runner.sources import (
    GRID_ABLATIONS,
    SourceSpec,
    make_source_specs,
)
from llm_astar_planner.cli.evaluate_options import (
    RULES,
    SEARCH_OPTIONS,
    add_input,
    add_rules,
    rules_given,
    wanted_of,
)
from llm_astar_planner.cli.run_options import (
    BAD_INPUT,
    INCOMPLETE,
    INTERRUPTED,
    OK,
    add_running,
    add_variants,
    check_variants,
    close_run,
    complain,
    deciding_files,
    live_settings,
    make_executor,
)
from llm_astar_planner.planning.parameters import costmap_config, defaults
from llm_astar_planner.planning.report import plan_report

# The traffic with models taken out of bags, in the results folder.
EXCHANGES = 'exchanges.jsonl'
EPILOG = """\
examples:
  llm-astar evaluate bag --list                       what it offers
  llm-astar evaluate bag --methods guided,exact_astar --params-file planner.yaml
  llm-astar evaluate monday tuesday.mcap --source replay --out out/field
  llm-astar evaluate bag --requests goals.csv --robot-radius 0.3
  llm-astar evaluate bag --methods guided --fail-under guided:valid=100    gate a release

Every request is planned on the map of its moment. --source replay without --transcript answers
from the traffic with models the bags hold.

exit codes: 0 ok, 1 threshold missed, 2 bad usage or input, 3 something was left out or went
unanswered, 130 interrupted
"""


def add_parser(subparsers: Any) -> None:  # noqa: ANN401 - argparse keeps its type private
    """Add the sub-command `evaluate`."""
    parser = subparsers.add_parser(
        'evaluate',
        description='Plan every request in rosbag2 bags (mcap or sqlite3) with every method and '
        'source, hold it against the recorded plan, and write a results folder as bench does.',
        epilog=EPILOG,
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    parser.set_defaults(run=run, command='evaluate', seed=0)
    parser.add_argument('bags', nargs='+', metavar='BAG', help='a folder, or an mcap or db3 file')
    add_input(parser.add_argument_group('input'))
    add_variants(parser.add_argument_group('methods and sources'))
    add_rules(parser.add_argument_group('rules, by the names of the parameters of planner_node'))
    add_running(parser.add_argument_group('running'), 'out/evaluate')
    names = ('methods', *SEARCH_OPTIONS.values())
    parser.set_defaults(unnamed={name: parser.get_default(name) for name in names})


def run(args: argparse.Namespace) -> int:
    """Evaluate bags or list them; return the exit code. Raises ValueError on bad input."""
    wanted, listed = wanted_of(args)
    if args.list:
        return _list(args, wanted)
    options = rules_given(args)
    check_variants(args)
    plans = ResultsBag(args.results_bag) if args.results_bag else None
    folder = ResultsFolder(args.out)
    with open_bags(args.bags) as (bags, unopened):
        try:
            if 'replay' in args.source and not args.transcript:
                args.transcript = str(_take_exchanges(args, bags, wanted, folder))
            sweep = _sweep(args, bags, wanted, listed, options)
            asked = [*args.bags, *([args.requests] if listed else [])]
            metadata = describe_run(asked, _parameters(args, sweep), deciding_files(args))
            metadata['bags'] = list(dict.fromkeys(bag_name(Path(path)) for path in args.bags))
            done = open_folder(folder, metadata, resume=args.resume)
        except ResultsError as error:
            return complain(args, str(error), BAD_INPUT)
        bag_run = BagTasks(sweep)
        try:
            tasks = bag_run.tasks(done)
            code = _plan(args, folder, metadata, tasks, sources=sweep.sources, plans=plans)
        except (ResultsError, BagWriteError) as error:
            return complain(args, str(error), INCOMPLETE)
        problems = [unopened, *(bag.problems for bag in bags)]
    metadata['left_out'] = [line for one in problems for line in one.lines()]
    metadata['notes'] = [line for one in problems for line in one.notes]
    return _close(args, folder, metadata, bag_run.kept.maps(), code)


def _plan(
    args: argparse.Namespace,
    folder: ResultsFolder,
    metadata: dict[str, Any],
    tasks: Iterator[Task],
    *,
    sources: Sequence[SourceSpec],
    plans: ResultsBag | None,
) -> int:
    """Run tasks into the folder; return 130 where that was interrupted.

    Raises ResultsError or BagWriteError where the disk takes no more.
    """
    running = make_executor(args, sources)
    try:
        with running as (executor, at_once), _watching(plans) as step:
            metadata['parameters']['jobs'] = args.dask or at_once // 2
            # Big maps wait in the queue, so it is no longer than it must be.
            few = max(1, at_once // 2)
            run_into_folder(folder, tasks, executor, few, metadata=metadata, step=step)
    except KeyboardInterrupt:
        left = 'the rows so far are kept; go on with --resume'
        return complain(args, f'interrupted: {left}', INTERRUPTED)
    return OK


@contextmanager
def _watching(bag: ResultsBag | None) -> Iterator[Callable[[Task, list[Outcome]], None]]:
    """Yield what shows the progress and writes the plans into a bag, if one is wanted."""
    with progress(None, 'request') as step, nullcontext() if bag is None else bag:

        def keep(task: Task, outcomes: list[Outcome]) -> None:
            if bag is not None:
                _show(bag, task, outcomes)
            step()

        yield keep


def _show(bag: ResultsBag, task: Task, outcomes: list[Outcome]) -> None:
    """Write what the methods made of a request into a bag."""
    grid_map = task.sample.barrier_map.to_grid()
    for row, plan in outcomes:
        if plan is not None and task.recorded_plan is not None:
            source = '/'.join(part for part in row.variant[1:] if part)
            points = grid_map.grid_to_world(plan.path)
            report = replace(plan_report(plan, grid_map), seconds_source=row.seconds_source)
            bag.add(
                row.method, source, grid_map, task.recorded_plan.time, points=points, report=report
            )


def _close(
    args: argparse.Namespace,
    folder: ResultsFolder,
    metadata: dict[str, Any],
    maps: Sequence[ProblemMap],
    code: int,
) -> int:
    """Say what was left out, and write what is read of a run."""
    for line in metadata['notes']:
        complain(args, f'note: {line}', OK)
    for line in metadata['left_out']:
        code = complain(args, f'left out: {line}', code or INCOMPLETE)
    try:
        save_kept_maps(maps, folder.path / MAPS_FILE)
    except OSError as error:
        return complain(args, f'{folder.path / MAPS_FILE}: {error.strerror or error}', INCOMPLETE)
    return close_run(args, folder, metadata, code)


def _list(args: argparse.Namespace, wanted: TopicSelection) -> int:
    """Show what bags offer; return 3 where one cannot be read or evaluated."""
    code = OK
    with open_bags(args.bags) as (bags, unopened):
        offers = [describe(bag, wanted) for bag in bags]
    for line in unopened.lines():
        code = complain(args, line, INCOMPLETE)
    if any(offer['missing'] or offer['left_out'] for offer in offers):
        code = INCOMPLETE
    print(json.dumps(offers) if args.json else '\n'.join(map(describe_text, offers)))
    return code


def _take_exchanges(
    args: argparse.Namespace, bags: Sequence[Bag], wanted: TopicSelection, folder: ResultsFolder
) -> Path:
    """Write the traffic the bags hold into the folder, as the transcript to replay.

    A folder that is gone on with has it. Raises ResultsError where results are in the way.
    """
    transcript = folder.path / EXCHANGES
    if args.resume and folder.results.exists() and transcript.exists():
        return transcript
    if not args.resume:
        folder.require_new()
    if not write_exchanges(bags, wanted, transcript):
        message = (
            '--source replay: the bags hold no exchanges with a model (on ~/exchange of '
            'llm_client_node); name a --transcript'
        )
        raise ValueError(message)
    return transcript


def _sweep(
    args: argparse.Namespace,
    bags: Sequence[Bag],
    wanted: TopicSelection,
    listed: Sequence[ListedRequest],
    options: dict[str, Any],
) -> EvaluationConfig:
    asked = defaults(RULES) | options
    settings = SearchSettings(
        args.heuristic,
        args.weight,
        args.time_limit,
        args.max_suboptimality,
        costmap_config(options),
        asked['tolerance'],
        asked['start_tolerance'],
        'corner_cutting' not in options and not args.params_file,
    )
    return EvaluationConfig(
        bags,
        replace(wanted, base_frame=asked['robot_base_frame']),
        args.methods,
        _sources(args, bags),
        settings,
        args.plan_window,
        listed,
    )


def _sources(args: argparse.Namespace, bags: Sequence[Bag]) -> list[SourceSpec]:
    """Make the sources; all ablations come along only where every map's barriers are known."""
    default = None if all(BARRIER_MAP in bag.topics for bag in bags) else GRID_ABLATIONS
    return make_source_specs(
        args.source,
        args.prompt,
        args.model,
        settings=live_settings(args),
        dataset=(),
        seed=args.seed,
        default=default,
    )


def _parameters(args: argparse.Namespace, sweep: EvaluationConfig) -> dict[str, Any]:
    names = (
        'seed', 'methods', 'source', 'prompt', 'model', 'base_url', 'repair_rounds', 'heuristic',
        'weight', 'time_limit', 'max_suboptimality', 'price', 'jobs', 'requests', 'plan_window',
    )  # fmt: skip
    settings, wanted = sweep.settings, sweep.selection
    return {name: getattr(args, name) for name in names} | {
        'rules': None if settings.costmap is None else asdict(settings.costmap),
        'tolerance': settings.tolerance,
        'start_tolerance': settings.start_tolerance,
        'paper_corners': settings.paper_corners,
        'topics': list(asdict(wanted).values()),
    }
