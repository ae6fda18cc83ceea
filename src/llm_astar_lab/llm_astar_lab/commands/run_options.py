# Copyright 2026 The LLM-A* for ROS 2 contributors
# SPDX-License-Identifier: Apache-2.0

"""The options and the last steps that `bench` and `evaluate` share."""

import argparse
import json
import sys
from collections.abc import Callable, Iterable, Mapping, Sequence
from pathlib import Path
from typing import Any, TypeVar

from llm_astar_msgs_adapter.errors import printable, raising
from llm_astar_msgs_adapter.maps.barrier_map import BarrierMap
from llm_astar_msgs_adapter.maps.places import Places
from llm_astar_msgs_adapter.maps.problem_maps import load_kept_maps
from llm_astar_planner.cli.flags import add_parameter_flags, at_least, named, option
from llm_astar_planner.cli.map_files import add_places_option
from llm_astar_planner.cli.planning_options import parameter_values, route_instruction
from llm_astar_planner.instructions.chain import make_interpreter
from llm_astar_planner.instructions.interpretation import RouteInstruction
from llm_astar_planner.parameter import Parameter, Scalar
from llm_astar_planner.planning.parameters import PLANNER, REQUESTS, SEARCH, SOURCE, defaults
from llm_astar_planner.planning.types import PlanRequest
from llm_astar_planner.resources import SAMPLES_FILE, find_file
from llm_astar_planner.search.methods import GUIDED, SEARCH_METHODS
from llm_astar_planner.waypoints.config import DEFAULT_PROMPT, SOURCE_NAMES, SourceSettings
from llm_astar_planner.waypoints.prompts.template import TEMPLATES, template_path
from llm_astar_planner.waypoints.source import SOURCES

from llm_astar_lab.analysis import thresholds
from llm_astar_lab.report.pages import text_report, write_report
from llm_astar_lab.results.folder import MAPS_FILE, ResultsFolder
from llm_astar_lab.results.row import WAYPOINTS_ONLY
from llm_astar_lab.results.stored_rows import Finished
from llm_astar_lab.runner import config, engine
from llm_astar_lab.runner.engine import Task
from llm_astar_lab.runner.sources import GRID_BASELINES, SourceOptions, SourceSpec

# Simultaneous requests to a live endpoint, unless --jobs says otherwise.
LIVE_JOBS = 8
INSTRUCTION = ('instruction', 'instruction_policy')
# The parameters that say where a model's replies come from, live or recorded.
ENDPOINT = (
    'base_url', 'api_key_env', 'api_key_names', 'prompt_form',
    'retrieved_examples', 'examples_file', 'sampling_seed',
)  # fmt: skip
# What is kept of a run, besides what its command adds.
DECIDING = (
    'seed', 'methods', 'source', 'prompt', 'model', 'base_url', 'prompt_form',
    'retrieved_examples', 'examples_file', 'heuristic', 'weight', 'max_suboptimality', 'jobs',
    'sampling_seed',
)  # fmt: skip
# The parameters of the search, with the defaults of the benchmark.
SEARCH_NAMES = ('heuristic', 'weight', 'max_suboptimality', 'max_planning_time')
SEARCH_PARAMETERS = [item.for_bench() for item in named((*SEARCH, *REQUESTS), *SEARCH_NAMES)]
Parsed = TypeVar('Parsed')
OK, MISSED, BAD_INPUT, INCOMPLETE, INTERRUPTED = 0, 1, 2, 3, 130


def names(text: str) -> list[str]:
    """Parse one or more names, separated by commas."""
    found = [name for name in text.split(',') if name]
    if not found:
        raise argparse.ArgumentTypeError('names are expected, separated by commas')
    return found


def file_names(text: str) -> list[str]:
    """Parse paths of files or names in maps/, separated by commas unless one has a comma."""
    if Path(text).is_file():
        return [text]
    return [str(find_file(name, 'maps')) for name in names(text)]


def parsed_by(parse: Callable[[str], Parsed]) -> Callable[[str], Parsed]:
    """Return a parser of an option's value whose ValueErrors argparse shows."""

    def parsed(text: str) -> Parsed:
        with raising(argparse.ArgumentTypeError, '', ValueError):
            return parse(text)

    return parsed


count, seed = at_least(1, int), at_least(0, int)


def add_variants(group: Any) -> None:  # noqa: ANN401 - argparse keeps its type private
    """Add the options that choose methods, sources, prompts and models."""
    text = f'of {", ".join(engine.ALL_METHODS)}, or plug-ins (default: all of these)'
    option(group, '--methods NAMES', text, type=names)
    option(
        group, '--source NAMES',
        f'of {", ".join(SOURCE_NAMES)}, or plug-ins (default: embedded and all baselines; '
        'the baselines are also added to every other source; on a grid only '
        f'{", ".join(GRID_BASELINES)}, because the others need a visibility graph, which is slow '
        'there and refused on large maps)', type=names, default=[],
    )  # fmt: skip
    text = f'for endpoint and replay: of {", ".join(TEMPLATES)}, or paths of templates'
    option(group, '--prompt NAMES', text, type=names, default=[])
    option(group, '--model NAMES', 'for endpoint and replay', type=names, default=[])
    option(
        group, '--transcript FILES',
        'transcripts that replay answers from: paths, or names in maps/, separated by '
        'commas; each gives rows of its own', type=file_names, action='extend', default=[],
    )  # fmt: skip
    add_defaulted_flags(group, SOURCE, ENDPOINT)
    add_parameter_flags(group, SEARCH_PARAMETERS)


def add_instruction(group: Any) -> None:  # noqa: ANN401 - argparse keeps its type private
    """Add the options of an instruction for every sample."""
    add_defaulted_flags(group, PLANNER, INSTRUCTION)
    add_places_option(group)


def add_defaulted_flags(group: Any, parameters: Iterable[Parameter], names: Sequence[str]) -> None:  # noqa: ANN401 - argparse keeps its type private
    """Add the flags of the named parameters, which have their defaults where not given."""
    items = named(parameters, *names)
    add_parameter_flags(group, items)
    group.set_defaults(**defaults(items))


def search_request(args: argparse.Namespace, places: Places, **others: Any) -> PlanRequest:  # noqa: ANN401 - its fields
    """Return what the requests of all samples share, by the options. Raises ValueError."""
    return PlanRequest(
        (0, 0), (0, 0), heuristic=args.heuristic, weight=args.weight,
        time_limit=args.max_planning_time, max_suboptimality=args.max_suboptimality,
        instruction=instruction_of(args, places), **others,
    )  # fmt: skip


def instruction_of(args: argparse.Namespace, places: Places) -> RouteInstruction | None:
    """Return what is understood of the instruction for every sample, None if there is none.

    The settings of a live or recorded model are those of the sources. Raises ValueError.
    """
    if args.instruction.strip() and 'replay' in args.source and len(args.transcript) > 1:
        raise ValueError('--instruction is replayed from one file: name one --transcript')
    values = {name: getattr(args, name) for name in ('base_url', 'api_key_env', 'api_key_names')}
    values['source'] = next((n for n in ('endpoint', 'replay') if n in args.source), 'none')
    values |= {name: next(iter(getattr(args, name)), '') for name in ('model', 'transcript')}
    found = route_instruction(
        vars(args), places, args.max_planning_time, lambda: make_interpreter(values)
    )
    if found is not None:
        read = found.interpretation
        sys.stderr.write(f'instruction {read.status.value}: {read.sentence}\n')
    return found


def add_running(group: Any, out: str) -> None:  # noqa: ANN401 - argparse keeps its type private
    """Add the options for running and output; `out` is the default folder."""
    config.add_folder(group, out)
    option(
        group, '--jobs N',
        'samples planned in parallel, and so also the number of simultaneous requests '
        '(default: 1, or 8 with a live source)', type=count,
    )  # fmt: skip
    option(
        group, '--format',
        f'of the rows: csv, or parquet for very many (default: csv, and parquet from '
        f'{config.LARGE_RUN:,} rows on; --resume keeps to the format of the folder)',
        choices=config.FORMATS,
    )  # fmt: skip
    option(
        group, '--fail-under --assert LIMIT',
        'VARIANT:METRIC=LIMIT in percent, or METRIC=LIMIT for all variants that have the '
        'metric, such as instruction=95; exit 1 if a ratio is above it or a share below',
        type=parsed_by(thresholds.parse_threshold), action='append', default=[],
    )  # fmt: skip
    option(group, '--json', 'print the summary as JSON')


def settle_variants(args: argparse.Namespace, file: Mapping[str, Scalar] | None = None) -> None:
    """Put the values of methods and search that flags, parameter files and defaults lead to.

    `file` is what parameter files set of planner_node, None without one. A bound of 0 becomes
    None. Raises ValueError on values that argparse cannot check.
    """
    if args.methods is None:
        method = (file or {}).get('method', GUIDED)
        args.methods = list(engine.ALL_METHODS) if file is None else [str(method)]
    for name in args.methods:
        SEARCH_METHODS.admit(name)
        problem = None if name in engine.ALL_METHODS else SEARCH_METHODS.problem(name)
        if problem:
            listed, mark, meant = problem.partition(';')
            raise ValueError(f'--methods {listed}, {WAYPOINTS_ONLY}{mark}{meant}')
    for name in args.source:
        SOURCES.admit(name)
        if problem := SOURCES.problem(name):
            raise ValueError(f'--source {problem}')
    vars(args).update(parameter_values(args, SEARCH_PARAMETERS, file))
    args.max_suboptimality = args.max_suboptimality or None


def source_specs(
    args: argparse.Namespace,
    folder: ResultsFolder,
    dataset: Sequence[BarrierMap],
    default: Sequence[str] | None,
) -> list[SourceSpec]:
    """Return the sources that the options lead to. Raises ValueError.

    What live models answer is recorded in the results folder. `default` names the baselines that
    are added, None for all of them.
    """
    values: dict[str, Any] = {name: getattr(args, name) for name in ENDPOINT}
    values |= {'timeout_s': args.max_planning_time, 'record': str(folder.transcript)}
    # The number of samples already bounds the calls.
    values |= {'max_concurrent': args.jobs or LIVE_JOBS, 'max_calls_per_hour': 0}
    rest = args.prompt, args.model, args.transcript, args.seed, default
    return SourceOptions(SourceSettings(**values), dataset, *rest).specs(args.source)


def check_thresholds(args: argparse.Namespace, sources: Sequence[SourceSpec]) -> None:
    """Raise ValueError where --fail-under names a variant that this run does not have."""
    variants = [variant for variant, _ in engine.list_variants(args.methods, sources)]
    if problem := thresholds.unknown_variant(args.fail_under, variants):
        raise ValueError(problem)


def deciding_parameters(args: argparse.Namespace, *more: str) -> dict[str, Any]:
    """Return the parameters of a run for its metadata, some of which --resume compares."""
    names = (*DECIDING, *more, *(INSTRUCTION if args.instruction else ()))
    found = {name: getattr(args, name) for name in names}
    return found | {'time_limit': args.max_planning_time}


def deciding_files(args: argparse.Namespace) -> list[Path]:
    """Return the transcripts, the prompt files and the places, which change the rows too."""
    files = [Path(transcript) for transcript in args.transcript]
    files += [find_file(args.places_file, 'maps')] if args.places_file else []
    if 'endpoint' in args.source:
        for prompt in args.prompt or [DEFAULT_PROMPT]:
            is_ours = prompt in TEMPLATES
            files.append(template_path(prompt) if is_ours else Path(prompt).expanduser())
        if args.retrieved_examples:
            files.append(find_file(args.examples_file or SAMPLES_FILE, 'maps'))
    return files


class Run:
    """A run into a results folder, by the options of its command.

    `metadata` is that of the folder, and `code` the exit code so far.
    """

    def __init__(
        self, args: argparse.Namespace, folder: ResultsFolder, metadata: dict[str, Any]
    ) -> None:
        """Take what is run; nothing is written yet."""
        self.args, self.folder, self.metadata = args, folder, metadata
        self.code, self._failure = OK, BAD_INPUT

    def open(self, rows: int = 0) -> Finished:
        """Start or resume the folder of a run of so many rows; return which of them it has.

        Raises ResultsError.
        """
        parquet = config.is_parquet_run(self.args.format, rows)
        again = {'resume': self.args.resume, 'overwrite': self.args.overwrite}
        return config.open_folder(self.folder, self.metadata, **again, parquet=parquet)

    def execute(self, tasks: Iterable[Task], sources: Sequence[SourceSpec], unit: str) -> None:
        """Run tasks into the folder. Raises ResultsError where it cannot be written to."""
        total = len(tasks) if isinstance(tasks, list) else None
        is_live = any(spec.name == 'endpoint' for spec in sources)
        jobs = self.args.jobs or (LIVE_JOBS if is_live else 1)
        self.metadata['parameters']['jobs'] = jobs
        engine.compile_once()
        self._failure = INCOMPLETE  # from here on there are rows
        try:
            with config.progress(total, unit) as step, config.timing(self.metadata):
                config.run_into_folder(self.folder, tasks, jobs, step)
        except KeyboardInterrupt:
            message = 'interrupted: the rows so far are kept; continue with --resume'
            self.complain(message, INTERRUPTED)

    def close(self) -> int:
        """Write the reports of a run, print the table, and return the exit code.

        Raises ResultsError where the folder cannot be written to.
        """
        # Reading the rows takes the most memory, so it comes before the maps are loaded.
        args, folder, metadata = self.args, self.folder, self.metadata
        folder.fold()
        rows = folder.stored()
        maps = load_kept_maps(folder.path / MAPS_FILE)
        unanswered = [*config.describe_unanswered(rows)]
        folder.write_json('metadata.json', metadata)
        has_zones = 'zones' in metadata['parameters']
        lengths = {} if has_zones else thresholds.reference_lengths(maps)
        every = rows.rows() if lengths else ()
        agreements = thresholds.compare_with_reference(every, lengths, args.heuristic)
        summary = write_report(folder, metadata, maps, rows)
        missed = thresholds.missed_thresholds(summary.variants, args.fail_under)
        print(json.dumps(folder.read_json('summary.json')) if args.json else text_report(summary))
        took = f'{len(rows)} rows in {metadata["seconds"]:.1f} s'
        print(f'{took}: {folder.path}/report.html', file=sys.stderr)
        for line in unanswered:
            self.complain(line, INCOMPLETE)
        for agreement in agreements:
            self.complain(str(agreement), INCOMPLETE if agreement.first else OK)
        for line in missed:
            self.complain(line, MISSED)
        return self.code

    def complain(self, message: str, code: int) -> None:
        """Write a message to stderr; the first code that is not OK is that of the run."""
        code = complain(self.args, message, code)
        self.code = self.code or code

    def failed(self, error: Exception) -> int:
        """Say why the run has ended, and return the exit code."""
        return complain(self.args, str(error), self._failure)


def complain(args: argparse.Namespace, message: str, code: int) -> int:
    """Write a message with the command's name to stderr; return `code`."""
    sys.stderr.write(f'llm-astar {args.command}: {printable(message)}\n')
    return code
