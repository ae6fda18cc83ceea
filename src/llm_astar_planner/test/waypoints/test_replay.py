"""Replay: recorded answers, found by sample, by the dataset's cells, or by the live key."""

from dataclasses import replace

import pytest
from llm_astar_msgs_adapter.maps.barrier_map import Barrier, BarrierMap, Sample
from llm_astar_msgs_adapter.maps.grid_map import GridMap, Pose2D
from llm_astar_planner.costmap.costmap import Costmap
from llm_astar_planner.waypoints.replay import NoSource, ReplayError, ReplaySource
from llm_astar_planner.waypoints.source import Message, SampleKey, SourceStatus, WaypointQuery
from llm_astar_planner.waypoints.transcript import Exchange, TranscriptWriter

MAP = BarrierMap(
    id=7,
    range_x=(-5, 15),
    range_y=(2, 12),
    horizontal_barriers=(Barrier(6, -5, 8),),
    samples=(Sample((0, 4), (9, 9)), Sample((-3, 4), (2, 9))),
)
EXCHANGE = Exchange(
    map=7,
    pair=1,
    scale=1,
    model='tiny',
    prompt='few_shot',
    messages=(Message('user', 'where to?'),),
    response='Generated Path: [[-3, 4], [9, 6], [2, 9]]',
    prompt_tokens=10,
    completion_tokens=5,
    seconds=0.25,
    status=SourceStatus.OK,
)
CELLS = ((2.0, 2.0), (14.0, 4.0), (7.0, 7.0))


def write(path, *exchanges):
    writer = TranscriptWriter(path)
    for exchange in exchanges:
        writer.write(exchange.to_json())
    return path


def ask(grid_map=None, sample=None, pair=1, barrier_map=MAP):
    chosen = barrier_map.samples[pair]
    return WaypointQuery(
        Costmap(grid_map or barrier_map.to_grid()),
        barrier_map.to_cell(chosen.start),
        barrier_map.to_cell(chosen.goal),
        sample=sample,
    )


def test_a_named_sample_is_answered_in_cells(tmp_path):
    source = ReplaySource(write(tmp_path / 't.jsonl', EXCHANGE))
    reply = source.waypoints(ask(sample=SampleKey(7, 1)))
    assert reply.waypoints == CELLS
    assert reply.status is SourceStatus.OK
    assert (reply.label, reply.model, reply.prompt) == ('replay:tiny', 'tiny', 'few_shot')
    assert (reply.prompt_tokens, reply.completion_tokens, reply.seconds) == (10, 5, 0.25)
    assert reply.text == EXCHANGE.response
    assert source.name == 'replay'


@pytest.mark.parametrize('scale', [1, 3])
def test_the_dataset_is_recognised_by_its_cells(tmp_path, scale):
    response = str([[x * scale, y * scale] for x, y in ((-3, 4), (9, 6), (2, 9))])
    path = write(tmp_path / 't.jsonl', replace(EXCHANGE, scale=scale, response=response))
    scaled = MAP.scale(scale)
    grid_map = GridMap(scaled.to_grid().cells, 0.05, Pose2D(3.21, -1.0), 'odom')
    source = ReplaySource(path, dataset=[replace(MAP, id=1, horizontal_barriers=()), MAP])
    reply = source.waypoints(ask(grid_map, barrier_map=scaled))
    corner = scaled.to_cell((0, 0))
    assert reply.waypoints == tuple(
        (x * scale + corner[0], y * scale + corner[1]) for x, y in ((-3, 4), (9, 6), (2, 9))
    )


def test_a_live_run_is_found_by_digest_and_cells(tmp_path):
    grid_map = MAP.to_grid()
    live = replace(
        EXCHANGE, map=grid_map.digest, pair='2,2->7,7', response='[[2, 2], [14, 4], [7, 7]]'
    )
    source = ReplaySource(write(tmp_path / 't.jsonl', live))
    assert source.waypoints(ask()).waypoints == CELLS
    missing = source.waypoints(ask(pair=0))
    assert missing.status is SourceStatus.MISSING
    assert missing.waypoints == ()
    for word in ('t.jsonl', grid_map.digest, '5,2->14,7', 'tiny', 'few_shot'):
        assert word in missing.detail


def test_a_sample_asked_about_live_is_found_by_its_cells_too(tmp_path):
    live = replace(
        EXCHANGE,
        map=MAP.to_grid().digest,
        pair='2,2->7,7',
        response='[[2, 2], [14, 4], [7, 7]]',
    )
    source = ReplaySource(write(tmp_path / 't.jsonl', live))
    assert source.waypoints(ask(sample=SampleKey(7, 1))).waypoints == CELLS
    assert source.waypoints(ask(sample=SampleKey(7, 0), pair=0)).status is SourceStatus.MISSING


def test_a_coarse_lattice_is_mapped_back_to_free_cells(tmp_path):
    grid_map = MAP.to_grid()
    live = replace(EXCHANGE, map=grid_map.digest, pair='2,2->7,7', response='[[1, 2]]', unit=4)
    source = ReplaySource(write(tmp_path / 't.jsonl', live))
    assert source.waypoints(ask()).waypoints == ((5.0, 8.0),)


def test_failures_and_odd_answers_keep_their_status(tmp_path):
    failed = replace(EXCHANGE, response='', status=SourceStatus.TIMEOUT)
    reply = ReplaySource(write(tmp_path / 'a.jsonl', failed)).waypoints(
        ask(sample=SampleKey(7, 1))
    )
    assert (reply.status, reply.waypoints) == (SourceStatus.TIMEOUT, ())
    for text, status in (
        ('Generated Path: []', SourceStatus.NO_WAYPOINTS),
        ('I do not know', SourceStatus.MALFORMED),
    ):
        path = write(tmp_path / f'{status.value}.jsonl', replace(EXCHANGE, response=text))
        assert ReplaySource(path).waypoints(ask(sample=SampleKey(7, 1))).status is status


def test_the_last_answered_exchange_counts(tmp_path):
    later = replace(EXCHANGE, response='[[-2, 3]]')
    failed = replace(EXCHANGE, response='', status=SourceStatus.TIMEOUT)
    source = ReplaySource(write(tmp_path / 't.jsonl', EXCHANGE, later, failed))
    assert source.waypoints(ask(sample=SampleKey(7, 1))).waypoints == ((3.0, 1.0),)


def test_an_empty_answer_counts_after_a_failure(tmp_path):
    failed = replace(EXCHANGE, response='', status=SourceStatus.TIMEOUT)
    source = ReplaySource(
        write(tmp_path / 't.jsonl', failed, replace(failed, status=SourceStatus.MALFORMED))
    )
    assert (source.answered, source.unanswered) == ({SampleKey(7, 1)}, frozenset())


def test_several_models_need_a_choice(tmp_path):
    other = replace(EXCHANGE, model='large', prompt='cot', response='[[1, 5]]')
    path = write(tmp_path / 't.jsonl', EXCHANGE, other)
    with pytest.raises(ReplayError, match=r'fits several.*model large, prompt cot; model tiny'):
        ReplaySource(path)
    with pytest.raises(ReplayError, match=r'model huge.*is not recorded; it holds: model large'):
        ReplaySource(path, model='huge')
    reply = ReplaySource(path, model='large').waypoints(ask(sample=SampleKey(7, 1)))
    assert (reply.prompt, reply.waypoints) == ('cot', ((6.0, 3.0),))
    with pytest.raises(ReplayError, match='it holds: nothing'):
        ReplaySource(write(tmp_path / 'empty.jsonl'))


def test_the_source_none_returns_no_waypoints():
    reply = NoSource().waypoints(ask())
    assert (reply.status, reply.label, reply.waypoints) == (SourceStatus.NONE, 'none', ())
