"""Runs over samples: which cases, what a row holds, and that no row is ever lost."""

import math
import pickle
import threading
import time
from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace

import numpy as np
import pytest
from llm_astar_msgs_adapter.maps.barrier_map import Barrier, BarrierMap, Sample, save_barrier_maps
from llm_astar_planner.benchmark.analysis.trace import trace
from llm_astar_planner.benchmark.datasets.generate import generate
from llm_astar_planner.benchmark.datasets.samples import (
    SelectionError,
    draw,
    load_samples,
    parse_ranges,
)
from llm_astar_planner.benchmark.results import (
    ResultsError,
    ResultsFolder,
    Variant,
    parse_points,
    turning_points,
)
from llm_astar_planner.benchmark.runner.config import (
    BenchmarkConfig,
    describe_unanswered,
    run_into_folder,
    start_run,
)
from llm_astar_planner.benchmark.runner.engine import (
    ALL_METHODS,
    SearchSettings,
    list_variants,
    make_tasks,
    plan_again,
    run_task,
    run_tasks,
)
from llm_astar_planner.benchmark.runner.sources import SourceSpec
from llm_astar_planner.planning.planner import Planner
from llm_astar_planner.planning.waypoint_filter import KEPT_BY_PAPER
from llm_astar_planner.waypoints.baselines import OracleSource, baseline_sources
from llm_astar_planner.waypoints.source import SourceStatus, WaypointReply

HALL = BarrierMap(
    3, (0, 51), (0, 31), (Barrier(10, 0, 25),), (), (Sample((5, 5), (5, 15), 'go round'),)
)
ORACLE = [SourceSpec(), SourceSpec(OracleSource(), 'oracle')]


@pytest.fixture
def dataset(tmp_path):
    path = tmp_path / 'maps.json'
    save_barrier_maps([HALL, *(replace(m, id=m.id + 10) for m in generate(1, 3))], path)
    return path


def tasks_of(samples, sources=ORACLE, methods=ALL_METHODS, scale=1):
    variants = list_variants(methods, sources)
    return make_tasks([(sample, scale) for sample in samples], variants, sources, SearchSettings())


def config_of(dataset, sources=ORACLE, methods=('llm_astar',), **values):
    return BenchmarkConfig(
        dataset, load_samples(dataset), methods, sources, SearchSettings(), **values
    )


def rows_of(task):
    return [outcome.row for outcome in run_task(task)]


def untimed(row):
    """Return a row's text without its times and beyond the digits that are stored."""
    length = round(row.length, 6)
    return str(replace(row, seconds_source=0.0, seconds_search=0.0, length=length))


class Fails:
    name = 'broken'

    def __init__(self, reply=None):
        self.reply, self.asked, self.busy, self.most = reply, 0, 0, 0
        self.lock = threading.Lock()

    def waypoints(self, _):
        with self.lock:
            self.asked += 1
            self.busy += 1
            self.most = max(self.most, self.busy)
        time.sleep(0.01)
        with self.lock:
            self.busy -= 1
        if self.reply is None:
            message = 'no such host'
            raise OSError(message)
        return self.reply


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
    assert len(variants) == 2 + 5 + 6


def test_a_source_is_asked_once_a_sample_whatever_the_number_of_methods(dataset):
    source = Fails(WaypointReply(((26.0, 10.0),)))
    sample = load_samples(dataset)[0]
    rows = rows_of(tasks_of([sample], [SourceSpec(), SourceSpec(source, 'live')])[0])
    assert source.asked == 1
    assert {row.waypoints for row in rows if row.source == 'live'} == {'26,10'}
    assert all(row.seconds_source >= 0.01 for row in rows if row.source == 'live')


def test_rows_say_what_came_of_each_case(dataset):
    rows = {str(row.variant): row for row in rows_of(tasks_of(load_samples(dataset)[:1])[0])}
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
def test_waypoints_alone_are_a_path_where_every_leg_is_free(dataset, waypoints, status, valid):
    source = Fails(WaypointReply(waypoints, status=status))
    sources = [SourceSpec(), SourceSpec(source, 'live')]
    rows = rows_of(tasks_of(load_samples(dataset)[:1], sources, ['waypoints_only'])[0])
    assert [row.found for row in rows] == [True, valid]


def test_a_source_that_raises_is_a_row_and_not_the_end(dataset):
    sources = [SourceSpec(), SourceSpec(Fails(), 'broken')]
    rows = rows_of(tasks_of(load_samples(dataset)[:1], sources, ['llm_astar'])[0])
    broken = rows[-1]
    assert (broken.source_status, broken.code, broken.guided_by) == ('ERROR', 'NONE', 'none')
    assert broken.operation == rows[1].operation
    (line,) = describe_unanswered(rows)
    assert line.startswith('llm_astar/broken: 1 samples without an answer (ERROR 1)')


def test_scaled_samples_are_the_same_samples_further_apart(dataset):
    samples = load_samples(dataset)[:1]
    small, large = (rows_of(tasks_of(samples, scale=scale)[0])[0] for scale in (1, 4))
    assert large.scale == 4
    assert large.length > 3 * small.length


def test_tasks_are_values_that_can_travel(dataset):
    task = tasks_of(load_samples(dataset)[:1])[0]
    again = rows_of(pickle.loads(pickle.dumps(task)))  # noqa: S301 - our own bytes
    assert [untimed(row) for row in again] == [untimed(row) for row in rows_of(task)]


def test_many_requests_are_in_flight_and_never_more_than_allowed(dataset):
    source = Fails(WaypointReply(((26.0, 10.0),)))
    rows = []
    tasks = tasks_of(
        load_samples(dataset), [SourceSpec(), SourceSpec(source, 'live')], ['llm_astar']
    )
    with ThreadPoolExecutor(4) as executor:
        run_tasks(tasks, executor, 8, lambda _, outcomes: rows.extend(outcomes))
    assert len(rows) == 3 * len(tasks)
    assert 2 <= source.most <= 4


def test_an_interrupted_run_keeps_its_rows_and_goes_on(dataset, tmp_path):
    config, folder = config_of(dataset), ResultsFolder(tmp_path / 'out')
    tasks, metadata = start_run(folder, config, {'seed': 0}, resume=False)
    steps = []

    def interrupt(*_):
        steps.append(1)
        if len(steps) == 5:
            raise KeyboardInterrupt

    with ThreadPoolExecutor(1) as executor, pytest.raises(KeyboardInterrupt):
        run_into_folder(folder, tasks, executor, 2, metadata=metadata, step=interrupt)
    kept = folder.read()
    assert len(kept) == 5 * 3
    folder.write_json('metadata.json', metadata)
    with folder.results.open('a') as file:
        file.write('13,2,1,astar,none')
    left, metadata = start_run(folder, config, {'seed': 0}, resume=True)
    assert len(left) == len(tasks) - 5
    with ThreadPoolExecutor(1) as executor:
        run_into_folder(folder, left, executor, 2, metadata=metadata, step=lambda *_: None)
    keys = [row.key for row in folder.read()]
    assert len(keys) == len(set(keys)) == 3 * len(tasks)


def test_going_on_asks_again_what_was_never_answered(dataset, tmp_path):
    folder = ResultsFolder(tmp_path / 'out')
    config = config_of(dataset, [SourceSpec(), SourceSpec(Fails(), 'broken')])
    tasks, metadata = start_run(folder, config, {'seed': 0}, resume=False)
    with ThreadPoolExecutor(2) as executor:
        run_into_folder(folder, tasks[:3], executor, 4, metadata=metadata, step=lambda *_: None)
    left, _ = start_run(folder, config, {'seed': 0}, resume=True)
    assert [len(task.variants) for task in left[:4]] == [1, 1, 1, 3]


def test_rows_of_another_run_are_not_mixed_in(dataset, tmp_path):
    folder, config = ResultsFolder(tmp_path / 'out'), config_of(dataset)
    start_run(folder, config, {'seed': 0}, resume=False)
    with pytest.raises(ResultsError, match='--resume'):
        start_run(folder, config, {'seed': 0}, resume=False)
    with pytest.raises(ResultsError, match=r'seed \(0 before\)'):
        start_run(folder, config, {'seed': 1}, resume=True)
    dataset.write_text(dataset.read_text() + '\n')
    with pytest.raises(ResultsError, match='dataset'):
        start_run(folder, config, {'seed': 0}, resume=True)


def test_a_run_cut_off_before_its_first_row_is_begun_anew(dataset, tmp_path):
    folder, config = ResultsFolder(tmp_path / 'out'), config_of(dataset)
    tasks, _ = start_run(folder, config, {'seed': 0}, resume=False)
    folder.results.unlink()
    assert len(start_run(folder, config, {'seed': 0}, resume=True)[0]) == len(tasks)


def test_a_damaged_row_is_named_and_of_twins_the_last_counts(dataset, tmp_path):
    folder = ResultsFolder(tmp_path / 'out')
    first, *_ = rows_of(tasks_of(load_samples(dataset)[:1])[0])
    again = replace(first, path='1,1;' * 50_000)  # longer than csv takes by itself
    folder.start()
    folder.append([first, again])
    assert [row.path for row in folder.read()] == [again.path]
    good = folder.results.read_text()
    for damaged in ('3,0,1,astar,none,,,NONE,1.0\n', good.splitlines()[1] + ',one more\n'):
        folder.results.write_text(good + damaged)
        with pytest.raises(ResultsError, match=r'results\.csv: line 4: \d+ values are expected'):
            folder.read()


def test_a_full_disk_is_said_and_earlier_rows_stay(dataset, tmp_path):
    folder = ResultsFolder(tmp_path / 'out')
    rows = rows_of(tasks_of(load_samples(dataset)[:1])[0])
    folder.start()
    folder.append(rows)
    kept = folder.results.read_bytes()
    full = ResultsFolder(tmp_path / 'full')
    full.path.mkdir()
    full.results.symlink_to('/dev/full')
    with pytest.raises(ResultsError, match='No space left on device; the rows before are kept'):
        full.append(rows)
    assert folder.results.read_bytes() == kept
    assert [untimed(row) for row in folder.read()] == [untimed(row) for row in rows]


def test_only_samples_at_scale_one_are_all_run_and_scales_share_theirs(dataset):
    config = config_of(dataset, scales=(1, 2, 3), scale_samples=4)
    tasks = config.tasks()
    by_scale = {s: {t.sample.key for t in tasks if t.scale == s} for s in (1, 2, 3)}
    assert len(by_scale[1]) == 31
    assert by_scale[2] == by_scale[3] < by_scale[1]
    assert len(by_scale[2]) == 4
    assert len(tasks) == 31 + 4 + 4


def test_selections(dataset):
    assert {sample.key[0] for sample in load_samples(dataset, '3,11-12')} == {3, 11, 12}
    few, more = (load_samples(dataset, limit=n, seed=2) for n in (3, 9))
    assert {sample.key for sample in few} < {sample.key for sample in more}
    assert draw(few, 50, 0) == few
    assert parse_ranges('1-3,7', '--scales') == [1, 2, 3, 7]


@pytest.mark.parametrize('text', ['', 'a', '3-', '5-1', '1,,2', '-4'])
def test_bad_ranges_are_named(text):
    with pytest.raises(SelectionError, match='--maps'):
        parse_ranges(text, '--maps')


def test_a_selection_that_leaves_nothing_lists_what_there_is(dataset):
    with pytest.raises(SelectionError, match='its ids are 3 to 12'):
        load_samples(dataset, '50-99')


def test_turning_points_keep_the_shape():
    path = np.array([(0, 0), (1, 0), (2, 0), (3, 1), (4, 2), (4, 3)], dtype=np.int32)
    assert turning_points(path).tolist() == [[0, 0], [2, 0], [4, 2], [4, 3]]
    assert len(turning_points(path[:0])) == 0


def test_a_row_can_be_planned_again_to_see_what_it_expanded(dataset):
    sample = load_samples(dataset)[0]
    for row in rows_of(tasks_of([sample], methods=['llm_astar'])[0]):
        plan = plan_again(sample.barrier_map, sample.sample, row, SearchSettings())
        assert (plan.expansions, plan.length) == (row.operation, row.length)


def test_the_traced_search_is_the_compiled_one(dataset):
    for sample in load_samples(dataset)[::4]:
        planner = Planner.for_barrier_map(sample.barrier_map)
        for row in rows_of(tasks_of([sample], methods=['llm_astar'])[0]):
            plan = plan_again(sample.barrier_map, sample.sample, row, SearchSettings())
            targets = [(p.x, p.y) for p in plan.checked_waypoints if p.status in KEPT_BY_PAPER]
            goals = [] if row.method == 'astar' else [*targets, sample.sample.goal]
            traced = trace(planner.costmap.blocked, *sample.sample[:2], goals)
            assert len(traced.order) == row.operation
            expanded = np.zeros_like(plan.expanded)
            expanded[tuple(np.array(traced.order).T[::-1])] = True
            assert (expanded == plan.expanded).all()
            assert traced.path[0] == sample.sample.start
