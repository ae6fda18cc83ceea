"""Tasks: which variants they have, what a row holds, and how they run in parallel."""

import math
import pickle
from concurrent.futures import Executor, Future, ThreadPoolExecutor

import numpy as np
import pytest
from benchmark_samples import FakeSource, planned_again, tasks_of, untimed
from llm_astar_lab.datasets.named import BenchmarkSample, load_samples
from llm_astar_lab.results.row import Variant, parse_points
from llm_astar_lab.runner.config import describe_unanswered
from llm_astar_lab.runner.engine import (
    MAX_CACHED_CELLS,
    MAX_CACHED_PLANNERS,
    SearchSettings,
    cache_size,
    list_variants,
    make_tasks,
    planner_for,
    run_task,
    run_tasks,
)
from llm_astar_lab.runner.sources import SourceSpec
from llm_astar_msgs_adapter.maps.barrier_map import Sample
from llm_astar_msgs_adapter.maps.grid_dataset import GridProblem
from llm_astar_msgs_adapter.maps.grid_map import GridMap
from llm_astar_planner.costmap.config import CostmapConfig
from llm_astar_planner.waypoints.baselines import baseline_sources
from llm_astar_planner.waypoints.source import SourceStatus, WaypointReply


def test_methods_without_waypoints_run_once_and_a_star_always():
    sources = [
        SourceSpec(),
        *(SourceSpec(source, name) for name, source in baseline_sources().items()),
    ]
    methods = ['weighted_astar', 'waypoints_only', 'llm_astar']
    variants = [variant for variant, _ in list_variants(methods, sources)]
    assert variants[:2] == [Variant('astar'), Variant('weighted_astar')]
    assert variants.count(Variant('llm_astar')) == 1
    assert Variant('waypoints_only') not in variants
    assert len(variants) == 2 + 6 + 7


def test_a_source_is_asked_once_per_sample_for_all_methods(dataset):
    source = FakeSource(WaypointReply(((26.0, 10.0),)))
    sample = load_samples(dataset)[0]
    rows = run_task(tasks_of([sample], [SourceSpec(), SourceSpec(source, 'live')])[0])
    assert source.asked == 1
    assert {row.waypoints for row in rows if row.source == 'live'} == {'26,10'}
    assert all(row.seconds_source >= 0.01 for row in rows if row.source == 'live')


def test_a_row_holds_the_result_of_its_variant(dataset):
    rows = {str(row.variant): row for row in run_task(tasks_of(load_samples(dataset)[:1])[0])}
    plain, guided = rows['astar/none'], rows['llm_astar/oracle']
    assert (plain.map, plain.pair, plain.scale, plain.code) == (3, 0, 1, 'NONE')
    assert guided.length == pytest.approx(plain.length)
    assert guided.operation < plain.operation
    assert (guided.guided_by, guided.verdicts) == ('oracle', 'accepted')
    alone = rows['waypoints_only/oracle']
    assert alone.length == pytest.approx(2 * np.hypot(21, 5))
    assert math.isnan(alone.operation)
    assert parse_points(alone.path) == ((5, 5), (26, 10), (5, 15))


@pytest.mark.parametrize(
    ('waypoints', 'status', 'valid'),
    [
        (((26.0, 10.0),), SourceStatus.OK, True),
        (((5.0, 5.0), (26.0, 10.0), (5.0, 15.0)), SourceStatus.OK, True),
        (((20.0, 12.0),), SourceStatus.OK, False),
        ((), SourceStatus.NO_WAYPOINTS, False),
        (((26.0, 10.0),), SourceStatus.TIMEOUT, False),
        (((float('nan'), 10.0),), SourceStatus.OK, False),
    ],
)
def test_waypoints_alone_are_a_path_where_every_segment_is_free(dataset, waypoints, status, valid):
    source = FakeSource(WaypointReply(waypoints, status=status))
    sources = [SourceSpec(), SourceSpec(source, 'live')]
    rows = run_task(tasks_of(load_samples(dataset)[:1], sources, ['waypoints_only'])[0])
    assert [row.found for row in rows] == [True, valid]


def test_a_source_that_raises_gives_a_row_and_does_not_end_the_run(dataset):
    sources = [SourceSpec(), SourceSpec(FakeSource(), 'broken')]
    rows = run_task(tasks_of(load_samples(dataset)[:1], sources, ['llm_astar'])[0])
    broken = rows[-1]
    assert (broken.source_status, broken.code, broken.guided_by) == ('ERROR', 'NONE', 'none')
    assert broken.operation == rows[1].operation
    (line,) = describe_unanswered(rows)
    assert line.startswith('llm_astar/broken: 1 samples without an answer (ERROR 1)')


def test_scaled_samples_have_longer_paths(dataset):
    samples = load_samples(dataset)[:1]
    small, large = (run_task(tasks_of(samples, scale=scale)[0])[0] for scale in (1, 4))
    assert large.scale == 4
    assert large.length > 3 * small.length


def test_tasks_can_be_pickled(dataset):
    task = tasks_of(load_samples(dataset)[:1])[0]
    again = run_task(pickle.loads(pickle.dumps(task)))  # noqa: S301 - our own bytes
    assert [untimed(row) for row in again] == [untimed(row) for row in run_task(task)]


def test_tasks_run_in_parallel_up_to_the_limit(dataset):
    source = FakeSource(WaypointReply(((26.0, 10.0),)))
    rows = []
    tasks = tasks_of(
        load_samples(dataset), [SourceSpec(), SourceSpec(source, 'live')], ['llm_astar']
    )
    with ThreadPoolExecutor(4) as executor:
        run_tasks(tasks, executor, 8, rows.extend)
    assert len(rows) == 3 * len(tasks)
    assert 2 <= source.most <= 4


def test_rows_of_tasks_that_finish_at_once_come_in_the_order_of_the_tasks(dataset):
    class Immediate(Executor):
        def submit(self, call, task):
            future = Future()
            future.set_result(call(task))
            return future

    tasks = tasks_of(load_samples(dataset), methods=['llm_astar'])
    kept = []
    run_tasks(tasks, Immediate(), len(tasks), kept.append)
    assert len(tasks) > 3
    assert [rows[0].key[:2] for rows in kept] == [task.sample.key for task in tasks]


def test_a_row_can_be_planned_again_to_see_what_it_expanded(dataset):
    sample = load_samples(dataset)[0]
    for row in run_task(tasks_of([sample], methods=['llm_astar'])[0]):
        _, plan = planned_again(sample, row)
        assert (plan.expansions, plan.length) == (row.operation, row.length)


def test_waypoints_alone_may_cross_what_the_planner_may_cross():
    """Cells of occupancy 80 are free for a threshold of 99, so their wall is no obstacle."""
    cells = np.zeros((5, 9), dtype=np.int8)
    cells[:, 4] = 80
    bare = GridProblem(0, GridMap(cells))
    sample = BenchmarkSample(bare, 0, Sample((0, 2), (8, 2)))
    sources = [SourceSpec(), SourceSpec(FakeSource(WaypointReply(((4.0, 2.0),))), 'live')]
    variants = list_variants(['waypoints_only'], sources)
    found = []
    for threshold in (65, 99):
        settings = SearchSettings(costmap=CostmapConfig(occupied_threshold=threshold))
        (task,) = make_tasks([(sample, 1)], variants, sources, settings)
        found.append([row.found for row in run_task(task)])
    assert found == [[False, False], [True, True]]


def test_planners_are_kept_by_map_and_rules_up_to_a_number_of_cells():
    small, rules = GridProblem(1, GridMap(np.zeros((3, 3), dtype=np.int8))), CostmapConfig()
    planner = planner_for(small, rules)
    assert planner_for(small, rules) is planner
    assert planner_for(small, CostmapConfig(corner_cutting=True)) is not planner
    assert cache_size(planner) * MAX_CACHED_PLANNERS == MAX_CACHED_CELLS
    for number in range(MAX_CACHED_PLANNERS):
        planner_for(GridProblem(2 + number, small.grid_map), rules)
    assert planner_for(small, rules) is not planner
