"""`llm-astar draw`: one sample, A* beside LLM-A*, as a picture, an animation or a window."""

from __future__ import annotations

import argparse
import math
from pathlib import Path
from typing import Any

from llm_astar_msgs_adapter.maps.barrier_map import (
    BarrierMap,
    Sample,
    find_barrier_map,
    load_barrier_maps,
)

from llm_astar_planner.benchmark.datasets.samples import BenchmarkSample
from llm_astar_planner.benchmark.points import parse_points
from llm_astar_planner.benchmark.results import Case, Row
from llm_astar_planner.benchmark.runner.engine import (
    BASELINE,
    Asker,
    Settings,
    plan_again,
    plan_tasks,
    run_task,
)
from llm_astar_planner.benchmark.runner.sources import make_askers
from llm_astar_planner.resources import find_file
from llm_astar_planner.waypoints.factory import SOURCES, SourceSettings


def add_parser(subparsers: Any) -> None:  # noqa: ANN401 - argparse keeps its type private
    """Add the sub-command `draw`."""
    parser = subparsers.add_parser(
        'draw',
        description='Draw what A* and LLM-A* expand on one sample: a picture (.png, .svg, .pdf), '
        'an animation (.gif), or a window where there is a display.',
    )
    parser.set_defaults(run=run)
    parser.add_argument(
        '--dataset', default='samples_1000.json', metavar='FILE',
        help='barrier-map JSON, a path or a name in maps/ (default: %(default)s)',
    )  # fmt: skip
    parser.add_argument('--map-id', type=int, default=0, metavar='ID', help='(default: 0)')
    parser.add_argument('--pair', type=int, default=0, metavar='N', help='(default: 0)')
    parser.add_argument(
        '--source', default='oracle', metavar='NAME',
        help=f'whose waypoints: of {", ".join(SOURCES)} (default: %(default)s)',
    )  # fmt: skip
    parser.add_argument(
        '--transcript', default='', metavar='FILE', help='what replay answers from'
    )
    parser.add_argument(
        '--prompt', default='', metavar='NAME', help='whose exchanges are replayed'
    )
    parser.add_argument('--model', default='', metavar='NAME', help='whose exchanges are replayed')
    parser.add_argument(
        '--out', required=True, metavar='FILE', help='its ending chooses picture or animation'
    )


def run(args: argparse.Namespace) -> int:
    """Draw; return 0. Raises ValueError on bad input."""
    maps = load_barrier_maps(find_file(args.dataset, 'maps'))
    barrier_map = find_barrier_map(maps, args.map_id)
    if not 0 <= args.pair < len(barrier_map.samples):
        message = f'--pair {args.pair}: map {barrier_map.id} has {len(barrier_map.samples)} pairs'
        raise ValueError(message)
    sample = barrier_map.samples[args.pair]
    rows = _rows(args, maps, BenchmarkSample(barrier_map, args.pair, sample))
    if Path(args.out).suffix.lower() != '.gif':
        _save_picture(args.out, barrier_map, sample, rows)
    else:
        _animate(args, barrier_map, sample, rows)
    print(args.out)
    return 0


def _rows(
    args: argparse.Namespace, maps: list[BarrierMap], sample: BenchmarkSample
) -> tuple[Row, Row]:
    """Run A*, and LLM-A* with the waypoints asked for."""
    settings = SourceSettings(transcript=args.transcript)
    askers = make_askers(
        [args.source],
        [args.prompt] if args.prompt else [],
        [args.model] if args.model else [],
        settings=settings,
        dataset=maps,
    )
    asker = next((item for item in askers if item.name == args.source), Asker())
    case = Case('llm_astar', asker.name, asker.prompt, asker.model)
    cases = [(BASELINE, 0), (case, 1)]
    (task,) = plan_tasks([(sample, 1)], cases, [Asker(), asker], Settings())
    plain, guided = (outcome.row for outcome in run_task(task))
    if not (plain.found and guided.found):
        message = f'map {plain.map}, pair {plain.pair}: {plain.code}, there is nothing to draw'
        raise ValueError(message)
    return plain, guided


def _save_picture(
    path: str, barrier_map: BarrierMap, sample: Sample, rows: tuple[Row, Row]
) -> None:
    # matplotlib takes most of a second to import, and bad usage should not wait for it.
    from llm_astar_planner.benchmark.report.figures import case_label, compare_figure  # noqa: PLC0415
    from llm_astar_planner.visualization.figures import write_figure  # noqa: PLC0415

    plans = [plan_again(barrier_map, sample, row, Settings()) for row in rows]
    ends = barrier_map.to_cell(sample.start), barrier_map.to_cell(sample.goal)
    titles = [case_label(row.case) for row in rows]
    figure = compare_figure(barrier_map.to_grid(), plans, titles, ends)
    write_figure(figure, path)


def _animate(
    args: argparse.Namespace, barrier_map: BarrierMap, sample: Sample, rows: tuple[Row, Row]
) -> None:
    from llm_astar_planner.benchmark.analysis.trace import trace  # noqa: PLC0415
    from llm_astar_planner.benchmark.report.animation import save_animation  # noqa: PLC0415
    from llm_astar_planner.benchmark.report.figures import case_label  # noqa: PLC0415
    from llm_astar_planner.planning.waypoint_filter import target_list  # noqa: PLC0415

    plan = plan_again(barrier_map, sample, rows[1], Settings())
    ends = barrier_map.to_cell(sample.start), barrier_map.to_cell(sample.goal)
    blocked = barrier_map.to_grid().blocked()
    targets = target_list(plan.waypoints, *ends)[1:]
    waypoints = [
        (math.floor(x + 0.5), math.floor(y + 0.5)) for x, y in parse_points(rows[1].waypoints)
    ]
    traces = [
        (case_label(rows[0].case), trace(blocked, *ends), ()),
        (case_label(rows[1].case), trace(blocked, *ends, targets), waypoints),
    ]
    Path(args.out).parent.mkdir(parents=True, exist_ok=True)
    save_animation(args.out, blocked, traces, ends)
