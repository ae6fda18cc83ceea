# Copyright 2026 The LLM-A* for ROS 2 contributors
# SPDX-License-Identifier: Apache-2.0

"""Measure on a suite how well route instructions are understood, enforced and reported.

Each instruction is understood by each source, planned, and the path held against the machine
checks of the suite, which share no code with the search or the enforcement. A suite is a JSON
file of maps, places and instructions with their truth.

usage: llm-astar instruct-bench [--suite FILE] [--source NAMES] [--show ID] [--out DIR]
                                [options]

sources:
  truth     the suite's own specification: the planner apart from understanding
  grammar   the grammar alone, no model
  reader    the grammar, then the small network of the package
  endpoint  both, then a language model for what they are not sure of
  replay    the same with a recorded model (--transcript)
  none      no instruction at all: what is met by chance

examples:
  llm-astar instruct-bench                        the grammar on the suite of the package
  llm-astar instruct-bench --suite house.json --source none,truth,grammar
  llm-astar instruct-bench --suite house.json --source endpoint --record house.jsonl --out out/x
    --base-url http://localhost:8080/v1 --model qwen2.5-coder-1.5b --timeout-s 60
  llm-astar instruct-bench --suite house.json --source replay --transcript house.jsonl
  llm-astar instruct-bench --suite house.json --show h-07 --png out/h-07.png
  llm-astar instruct-bench --check                right and wrong readings: which may be claimed
  llm-astar instruct-bench --json | jq -e '.grammar.all.false_claims.count == 0'   gate a release

a suite, with the map in house.yaml beside it:
  {"version": 1,
   "maps": {"house": {"places": {"kitchen": {"polygon": [[8,10],[16,10],[16,18],[8,18]]}}}},
   "instructions": [{"id": "h-01", "map": "house", "start": [2, 2], "goal": [22, 16],
     "text": "do not enter the kitchen", "lang": "en", "style": "templated", "expect": "ok",
     "spec": {"clauses": [{"kind": "avoid", "region": {"place": "kitchen"}}]},
     "checks": [{"check": "inside_max", "region": {"place": "kitchen"}, "metres": 0.1}]}]}

exit codes: 0 ok, 1 --show found no path, 2 bad usage or input, 3 a model left instructions
unanswered, 130 interrupted
"""

import argparse
import json
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any

from llm_astar_planner.cli import flags
from llm_astar_planner.costmap.costmap import Costmap
from llm_astar_planner.instructions.chain import make_interpreter
from llm_astar_planner.instructions.grammar.interpreter import GrammarInterpreter
from llm_astar_planner.instructions.route import Route
from llm_astar_planner.planning.compile import compile_instruction_kernels
from llm_astar_planner.planning.parameters import PLANNER, SOURCE, defaults, request_fields
from llm_astar_planner.planning.types import PlanRequest
from llm_astar_planner.resources import find_file

from llm_astar_lab.commands import run_options as common
from llm_astar_lab.instruct_bench import claims, report
from llm_astar_lab.instruct_bench import runner as running
from llm_astar_lab.instruct_bench.runner import InstructionResult, Source
from llm_astar_lab.instruct_bench.suite import Suite, SuiteInstruction, load_suite
from llm_astar_lab.results.folder import ResultsFolder, describe_run, format_csv
from llm_astar_lab.runner.config import progress

OWN_SUITE = 'instructions/suite.json'
GRAMMAR, READER, ENDPOINT, REPLAY = 'grammar', 'reader', 'endpoint', 'replay'
SOURCES = (running.TRUTH, GRAMMAR, READER, ENDPOINT, REPLAY, running.NO_INSTRUCTION)
# The parameters of llm_client_node that matter to a model that understands instructions.
MODEL = flags.named(
    SOURCE, 'base_url', 'api_key_env', 'api_key_names', 'model', 'temperature',
    'max_output_tokens', 'timeout_s', 'max_retries', 'transcript', 'record',
)  # fmt: skip
TIME = flags.named(PLANNER, 'max_planning_time')


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the options."""
    what = parser.add_argument_group('suite')
    text = 'the suite: a JSON file, a path or a name in maps/ (default: %(default)s)'
    flags.option(what, '--suite FILE', text, default=OWN_SUITE)
    text = "searched for NAME.yaml of the suite's maps, after the suite's own folder"
    flags.option(what, '--map-folder DIR', text, type=Path, action='append', default=[])
    text = 'text, what was understood, clauses with what became of them, checks'
    flags.option(what, '--show ID', f'run one instruction and print all of it: {text}')
    text = 'right and wrong readings of the suite, as a good and a bad model would give them'
    flags.option(what, '--check', f'measure the check of claims by itself: {text}')
    sources = parser.add_argument_group('sources')
    text = f'one or more of {", ".join(SOURCES)} (default: {GRAMMAR})'
    flags.option(
        sources, '--source NAME', text, type=common.names, nargs='+', action='extend', default=[]
    )
    flags.add_parameter_flags(sources, (*MODEL, *TIME))
    add_output(parser.add_argument_group('output'))


def add_output(group: Any) -> None:  # noqa: ANN401 - argparse keeps its type private
    """Add the options for output and summary."""
    flags.option(group, '--out DIR', 'write results.csv, summary.json and report.md into a folder')
    flags.option(group, '--json', 'print one JSON object')
    text = 'draw the plan of --show, with a single --source'
    flags.option(group, '--png FILE', text, type=flags.picture_file)


def run(args: argparse.Namespace) -> int:
    """Run a suite; return the exit code. Raises ValueError or ResultsError on bad input."""
    chosen = list(dict.fromkeys(name for part in args.source for name in part)) or [GRAMMAR]
    check_options(args, chosen)
    suite = load_suite(find_file(args.suite, 'maps'), args.map_folder)
    if args.check:
        print(claims.table(claims.measured(map(check_case, suite.instructions))))
        return common.OK
    sources = make_sources(chosen, model_values(args))
    compile_instruction_kernels()
    chosen_ones = [suite.find(args.show)] if args.show else suite.instructions
    made = running.SuiteRunner(common_request(args)).run(chosen_ones, sources)
    if args.show:
        return show(args, list(made))
    folder = ResultsFolder(args.out) if args.out else None
    if folder is not None:
        folder.require_new()
    code, results = run_suite(args, made, len(suite.instructions) * len(sources))
    if folder is not None and results:
        write_results(folder, suite, chosen, results)
    if results:
        summary = report.summary_to_json(results) if args.json else report.text_summary(results)
        print(json.dumps(summary) if args.json else summary)
    for line in report.unanswered_lines(results):
        code = common.complain(args, line, code or common.INCOMPLETE)
    return code


def check_case(instruction: SuiteInstruction) -> claims.CheckCase:
    """Return an instruction of a suite with what it means, for the check of claims."""
    truths = [
        spec.to_json()['clauses']
        for spec in (instruction.truth, *instruction.accepted)
        if spec.enforceable
    ]
    places = instruction.suite_map.places
    return claims.CheckCase(instruction.text, places, instruction.lang, truths)


def check_options(args: argparse.Namespace, chosen: Sequence[str]) -> None:
    """Raise ValueError for an unknown source and for options that do not go together."""
    for name in chosen:
        if name not in SOURCES:
            raise ValueError(f'--source {name!r} is unknown; available are {", ".join(SOURCES)}')
    if args.png and not (args.show and len(chosen) == 1):
        raise ValueError('--png draws one plan: name one instruction with --show and one --source')
    if REPLAY in chosen and not args.transcript:
        raise ValueError('--source replay answers from a --transcript: name one')
    if args.record and ENDPOINT not in chosen:
        raise ValueError('--record keeps exchanges of --source endpoint; no other has any')


def model_values(args: argparse.Namespace) -> dict[str, Any]:
    """Return the settings of a model by parameter name. Raises ParameterError."""
    values = defaults(SOURCE, cli=True) | flags.given_values(args, MODEL)
    if values['transcript']:
        values['transcript'] = str(find_file(values['transcript'], 'maps'))
    # The number of instructions already bounds the calls.
    return values | {'max_calls_per_hour': 0}


def make_sources(chosen: Sequence[str], values: dict[str, Any]) -> list[Source]:
    """Return the sources by name; raises what the interpreters raise for their settings."""
    made = {running.TRUTH: running.TRUE_SOURCE, running.NO_INSTRUCTION: running.NO_SOURCE}
    for name in (name for name in chosen if name not in made):
        settings = values | {'source': running.NO_INSTRUCTION if name == READER else name}
        made_of = GrammarInterpreter() if name == GRAMMAR else make_interpreter(settings)
        made[name] = running.interpreter_source(name, made_of, values['timeout_s'])
    return [made[name] for name in chosen]


def common_request(args: argparse.Namespace) -> PlanRequest:
    """Return what all requests have in common, by the defaults of `llm-astar plan`."""
    values = defaults(PLANNER, cli=True) | flags.given_values(args, TIME)
    # A picture shows the expanded cells.
    return PlanRequest((0, 0), (0, 0), want_expanded=bool(args.png), **request_fields(values))


def run_suite(
    args: argparse.Namespace, made: Iterator[InstructionResult], total: int
) -> tuple[int, list[InstructionResult]]:
    """Return the exit code and all results as they are made, those so far if interrupted."""
    results: list[InstructionResult] = []
    with progress(total, 'result') as step:
        try:
            for result in made:
                results.append(result)
                step()
        except KeyboardInterrupt:
            message = f'interrupted after {len(results)} results, which are kept'
            return common.complain(args, message, common.INTERRUPTED), results
    return common.OK, results


def write_results(
    folder: ResultsFolder, suite: Suite, chosen: list[str], results: Sequence[InstructionResult]
) -> None:
    """Write rows, figures and report. Raises ResultsError."""
    rows = [report.result_row(result) for result in results]
    lines = [list(rows[0]), *(list(map(str, row.values())) for row in rows)]
    folder.write_text('results.csv', format_csv(lines))
    metadata = describe_run([suite.path], {'sources': chosen})
    folder.write_json('summary.json', metadata | {'sources': report.summary_to_json(results)})
    folder.write_text('report.md', report.markdown_summary(results, metadata))


def show(args: argparse.Namespace, results: Sequence[InstructionResult]) -> int:
    """Print the results of one instruction in full, and draw it; return the exit code."""
    if args.json:
        outcomes = [result.outcome and result.outcome.to_json() for result in results]
        shown = [
            report.result_row(result) | {'outcome': outcome, 'path': result.plan.path.tolist()}
            for result, outcome in zip(results, outcomes)
        ]
        print(json.dumps(shown))
    else:
        print('\n\n'.join(map(report.chain_text, results)))
    if args.png:
        draw(results[0], args.png)
    return common.OK if all(result.plan.code == 0 for result in results) else common.MISSED


def draw(result: InstructionResult, path: str) -> None:
    """Draw the plan of a result into a file. Raises OSError and ValueError."""
    # Importing matplotlib takes most of a second.
    from llm_astar_lab.pictures.of_commands import draw_plan  # noqa: PLC0415

    plan, suite_map = result.plan, result.instruction.suite_map
    barriers = suite_map.barrier_map
    offset = (0, 0) if barriers is None else barriers.offset
    route = Route(Costmap(suite_map.grid_map), plan.start, plan.goal, suite_map.places)
    draw_plan(plan, route, offset, path)
