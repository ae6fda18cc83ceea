"""Draw the cells that A* and LLM-A* expand on one sample.

The file is a picture (.png, .svg, .pdf) or an animation (.gif).
"""

from __future__ import annotations

import argparse
import math
from pathlib import Path

from llm_astar_msgs_adapter.maps.barrier_map import BarrierMap, find_barrier_map, load_barrier_maps

from llm_astar_planner.benchmark.datasets.samples import BenchmarkSample
from llm_astar_planner.benchmark.results import PAPER_ASTAR, Row, Variant, parse_points
from llm_astar_planner.benchmark.runner.engine import (
    SearchSettings,
    make_tasks,
    plan_again,
    run_task,
)
from llm_astar_planner.benchmark.runner.sources import SourceSpec, make_source_specs
from llm_astar_planner.resources import find_file
from llm_astar_planner.waypoints.config import SOURCE_NAMES, SourceSettings


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the options."""
    parser.add_argument(
        '--dataset', default='samples_1000.json', metavar='FILE',
        help='barrier-map JSON, a path or a name in maps/ (default: %(default)s)',
    )  # fmt: skip
    parser.add_argument('--map-id', type=int, default=0, metavar='ID', help='(default: 0)')
    parser.add_argument('--pair', type=int, default=0, metavar='N', help='(default: 0)')
    parser.add_argument(
        '--source', default='oracle', metavar='NAME',
        help=f'waypoint source, one of {", ".join(SOURCE_NAMES)} (default: %(default)s)',
    )  # fmt: skip
    parser.add_argument('--transcript', default='', metavar='FILE', help='transcript to replay')
    parser.add_argument('--prompt', default='', metavar='NAME', help='prompt to replay')
    parser.add_argument('--model', default='', metavar='NAME', help='model to replay')
    parser.add_argument(
        '--out', required=True, metavar='FILE', help='picture or animation, by its ending'
    )


def run(args: argparse.Namespace) -> int:
    """Draw; return 0. Raises ValueError on bad input."""
    maps = load_barrier_maps(find_file(args.dataset, 'maps'))
    barrier_map = find_barrier_map(maps, args.map_id)
    if not 0 <= args.pair < len(barrier_map.samples):
        message = f'--pair {args.pair}: map {barrier_map.id} has {len(barrier_map.samples)} pairs'
        raise ValueError(message)
    sample = BenchmarkSample(barrier_map, args.pair, barrier_map.samples[args.pair])
    rows = plan_sample(args, maps, sample)
    if Path(args.out).suffix.lower() == '.gif':
        write_animation(args.out, barrier_map, sample, rows)
    else:
        write_picture(args.out, barrier_map, sample, rows)
    print(args.out)
    return 0


def plan_sample(
    args: argparse.Namespace, maps: list[BarrierMap], sample: BenchmarkSample
) -> tuple[Row, Row]:
    """Plan a sample with A*, and with LLM-A* and the chosen source. Raises ValueError."""
    specs = make_source_specs(
        [args.source],
        [args.prompt] if args.prompt else [],
        [args.model] if args.model else [],
        settings=SourceSettings(transcript=args.transcript),
        dataset=maps,
    )
    spec = next((item for item in specs if item.name == args.source), SourceSpec())
    variants = [(PAPER_ASTAR, 0), (Variant('llm_astar', spec.name, spec.prompt, spec.model), 1)]
    (task,) = make_tasks([(sample, 1)], variants, [SourceSpec(), spec], SearchSettings())
    plain, guided = (outcome.row for outcome in run_task(task))
    if not (plain.found and guided.found):
        message = f'map {plain.map}, pair {plain.pair}: {plain.code}, there is nothing to draw'
        raise ValueError(message)
    return plain, guided


def write_picture(
    path: str, barrier_map: BarrierMap, sample: BenchmarkSample, rows: tuple[Row, Row]
) -> None:
    """Draw the two plans side by side."""
    # Importing matplotlib takes most of a second, which bad usage should not wait for.
    from llm_astar_planner.benchmark.report import figures  # noqa: PLC0415
    from llm_astar_planner.visualization.figures import write_figure  # noqa: PLC0415

    plans = [plan_again(barrier_map, sample.sample, row, SearchSettings()) for row in rows]
    endpoints = [barrier_map.to_cell(point) for point in sample.sample[:2]]
    titles = [figures.variant_label(row.variant) for row in rows]
    start, goal = endpoints
    write_figure(
        figures.comparison_figure(barrier_map.to_grid(), plans, titles, (start, goal)), path
    )


def write_animation(
    path: str, barrier_map: BarrierMap, sample: BenchmarkSample, rows: tuple[Row, Row]
) -> None:
    """Draw the two searches expanding side by side."""
    from llm_astar_planner.benchmark.analysis.trace import trace  # noqa: PLC0415
    from llm_astar_planner.benchmark.report import figures  # noqa: PLC0415
    from llm_astar_planner.planning.waypoint_filter import target_list  # noqa: PLC0415

    plan = plan_again(barrier_map, sample.sample, rows[1], SearchSettings())
    start, goal = (barrier_map.to_cell(point) for point in sample.sample[:2])
    blocked = barrier_map.to_grid().blocked()
    targets = target_list(plan.checked_waypoints, start, goal)[1:]
    waypoints = [
        (math.floor(x + 0.5), math.floor(y + 0.5)) for x, y in parse_points(rows[1].waypoints)
    ]
    plain, guided = (figures.variant_label(row.variant) for row in rows)
    searches = [
        (plain, trace(blocked, start, goal), ()),
        (guided, trace(blocked, start, goal, targets), waypoints),
    ]
    Path(path).parent.mkdir(parents=True, exist_ok=True)
    figures.save_animation(path, blocked, searches, (start, goal))
