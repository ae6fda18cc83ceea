"""The requests of a bag: their start, goal and map, and the plan recorded for them."""

import shutil

import numpy as np
import pytest
from bag_makers import (
    EVENT,
    answer_at,
    at,
    call_at,
    goal_at,
    map_at,
    odometry_at,
    plan_at,
    report_at,
    room,
    start_at,
    tf_at,
    write_bag,
)
from llm_astar_lab.bags.reading import Bag
from llm_astar_lab.bags.types import barrier_map_text
from llm_astar_lab.evaluation.requests import (
    RequestReader,
    TopicSelection,
    describe,
)
from llm_astar_msgs_adapter.maps.barrier_map import Barrier, BarrierMap, Sample

WAY = [(2.0, 2.0), (5.0, 5.0), (8.0, 8.0)]


@pytest.fixture
def ask(tmp_path):
    """Return a function that writes messages as a bag and returns its requests and problems."""

    def read(messages, window=10.0, **wanted):
        folder = write_bag(tmp_path / 'bag', messages)
        with Bag(folder) as bag:
            reader = RequestReader(bag, TopicSelection(**wanted), window)
            return list(reader.requests()), bag.problems

    return read


def places(requests):
    return [(request.start[:2], request.goal[:2]) for request in requests]


def test_a_request_is_planned_on_the_map_of_its_time(ask):
    first, second = room(), room(30, 12, (4, 4))
    requests, problems = ask([
        map_at(1, first), call_at(2, (2, 2), (8, 8), 1),
        map_at(3, second), call_at(4, (3, 3), (9, 9), 2),
    ])  # fmt: skip
    assert [request.grid_map.digest for request in requests] == [first.digest, second.digest]
    assert places(requests) == [((2, 2), (8, 8)), ((3, 3), (9, 9))]
    assert not problems.left_out


def test_a_call_recorded_by_client_and_server_is_one_request(ask):
    call = call_at(2, (2, 2), (8, 8), 7)
    requests, _ = ask([map_at(1, room()), call, (EVENT, 2.001, call[2])])
    assert len(requests) == 1


def test_events_without_contents_are_named(ask):
    call = call_at(2, (2, 2), (8, 8))
    call[2].request = []
    requests, problems = ask([map_at(1, room()), call])
    assert not requests
    assert 'set service introspection to `contents`' in problems.left_out[0]


def test_a_request_before_the_first_map_is_left_out_and_the_next_is_not(ask):
    requests, problems = ask([
        call_at(1, (2, 2), (8, 8), 1), map_at(2, room()), call_at(3, (2, 2), (8, 8), 2),
    ])  # fmt: skip
    assert [request.index for request in requests] == [1]
    assert 'at 0.000 s: a request before the first map' in problems.left_out[0]


def test_a_goal_starts_at_the_pose_of_tf_else_odometry_else_initialpose(ask):
    requests, problems = ask([
        map_at(1, room()), goal_at(2, (8, 8)),
        start_at(3, (2, 2)), goal_at(4, (8, 8)),
        odometry_at(5, (3, 3)), goal_at(6, (8, 8)),
        tf_at(7, 'map', 'odom', (1.0, 1.0)), tf_at(7, 'odom', 'base_link', (3.0, 4.0)),
        goal_at(8, (8, 8)), goal_at(30, (8, 8)),
    ])  # fmt: skip
    assert [request.start[:2] for request in requests] == [(2, 2), (3, 3), (4, 5), (3, 3)]
    assert 'a request whose start is not known' in problems.left_out[0]


def test_without_tf_a_goal_starts_at_amcl_pose_and_unusable_odometry_is_named(ask):
    requests, problems = ask([
        map_at(1, room()), odometry_at(2, (3, 3), 'odom'), goal_at(3, (8, 8)),
        start_at(4, (2, 2)), start_at(5, (4, 4), topic='/amcl_pose'), goal_at(6, (8, 8)),
    ])  # fmt: skip
    assert places(requests) == [((4, 4), (8, 8))]
    assert "odometry is in frame 'odom', the map in 'map', and no tf" in problems.left_out[0]
    assert 'no amcl_pose or initialpose yet' in problems.left_out[0]


def test_without_goals_and_calls_each_path_of_the_robot_is_a_request(ask):
    """As in a bag of Nav2 whose goals came through an action."""
    better = [(2.0, 2.0), (8.0, 8.0)]
    messages = [
        map_at(1, room()), plan_at(2, WAY), plan_at(2.5, better, 2), plan_at(3, []),
        plan_at(4, [(5.0, 5.0), (9.0, 2.0)]),
    ]  # fmt: skip
    requests, problems = ask([*messages, report_at(4.1, 'NONE', [], 4)])
    assert places(requests) == [((2, 2), (8, 8)), ((5, 5), (9, 2))]
    assert [len(request.points) for request in requests] == [2, 2]
    (note,) = problems.notes
    assert 'goals of actions are not recorded: each path on /plan is a request' in note
    assert not problems.left_out


def test_paths_are_not_requests_where_there_are_goals_unless_selected(ask, tmp_path):
    messages = [map_at(1, room()), start_at(1, (2, 2)), goal_at(2, (8, 8)), plan_at(3, WAY)]
    requests, _ = ask(messages)
    assert [request.time for request in requests] == [at(2)]
    assert requests[0].points.tolist() == [list(point) for point in WAY]
    shutil.rmtree(tmp_path / 'bag')
    requests, problems = ask(messages, requests='plans')
    assert [request.time for request in requests] == [at(3)]
    assert not problems.notes


def test_a_goal_in_another_frame_is_transformed_by_tf_and_left_out_without(ask):
    requests, problems = ask([
        map_at(1, room()), start_at(1, (2, 2)), goal_at(2, (3, 3), 'odom'),
        tf_at(3, 'map', 'odom', (1.0, 2.0), '/tf_static'), goal_at(90, (3, 3), 'odom'),
    ])  # fmt: skip
    assert [request.goal[:2] for request in requests] == [(4, 5)]
    assert "goal is in frame 'odom', the map in 'map'" in problems.left_out[0]


def test_a_response_belongs_to_its_own_call(ask):
    requests, _ = ask([
        map_at(1, room()), call_at(2, (2, 2), (8, 8), 1), call_at(2.1, (3, 2), (8, 8), 2),
        answer_at(2.2, WAY, 2), answer_at(2.3, [], 1),
    ])  # fmt: skip
    assert len(requests[0].points) == 0
    np.testing.assert_allclose(requests[1].points, WAY)


def test_the_plan_of_a_goal_is_the_first_that_ends_there_within_the_window(ask):
    elsewhere = [(2.0, 2.0), (3.0, 3.0)]
    messages = [
        map_at(1, room()), start_at(1, (2, 2)), goal_at(2, (8, 8)),
        plan_at(3, elsewhere), plan_at(4, WAY), plan_at(5, [*WAY, (8.0, 8.1)]),
    ]  # fmt: skip
    requests, _ = ask(messages)
    np.testing.assert_allclose(requests[0].points, WAY)


def test_a_plan_after_the_window_does_not_belong_to_the_request(ask):
    requests, _ = ask([
        map_at(1, room()), start_at(1, (2, 2)), goal_at(2, (8, 8)), plan_at(4, WAY),
    ], window=1.0)  # fmt: skip
    assert requests[0].points is None


def test_the_last_plan_with_one_stamp_and_its_report_are_recorded(ask):
    better = [(2.0, 2.0), (8.0, 8.0)]
    requests, _ = ask([
        map_at(1, room()), start_at(1, (2, 2)), goal_at(2, (8, 8)),
        plan_at(3, WAY, 2.5), plan_at(3.1, better, 2.5),
        report_at(3.2, 'NONE', [[5.0, 5.0, 'accepted']], 2.5),
    ])  # fmt: skip
    np.testing.assert_allclose(requests[0].points, better)
    assert requests[0].code == 'NONE'
    assert requests[0].waypoints == ((5.0, 5.0),)


@pytest.mark.parametrize('waypoints', [f'[[1{"0" * 400}, 1]]', '[' * 100_000])
def test_a_report_with_malformed_numbers_is_ignored(ask, waypoints):
    report = report_at(3, 'NONE', [], 3)
    report[2].status[0].values[1].value = waypoints
    (request,), _ = ask([map_at(1, room()), call_at(2, (2, 2), (8, 8)), report])
    assert request.code == ''


def test_the_pose_of_the_robot_is_forgotten_when_the_clock_jumps_back(ask):
    requests, problems = ask([
        map_at(100, room()), start_at(101, (2, 2)), goal_at(102, (8, 8)),
        map_at(1, room()), goal_at(2, (8, 8)), start_at(3, (4, 4)), goal_at(4, (8, 8)),
    ])  # fmt: skip
    assert [request.start[:2] for request in requests] == [(2, 2), (4, 4)]
    assert any('clock jumps back' in note for note in problems.notes)
    assert 'start is not known' in problems.left_out[0]


def test_a_refused_map_leaves_the_last_valid_one(ask):
    broken = map_at(2, room())
    broken[2].info.width = 3
    requests, problems = ask([map_at(1, room()), broken, call_at(3, (2, 2), (8, 8))])
    assert requests[0].grid_map.width == 20
    assert 'a map is refused, data: 200 cells do not fill' in problems.left_out[0]


def test_barriers_are_used_only_for_the_map_made_from_them(ask):
    barriers = BarrierMap(7, (0, 20), (0, 12), (Barrier(5, 3, 9),), (), (Sample((2, 2), (8, 8)),))
    text = '/chatter', 0.5, barrier_map_text(barriers)
    on_topic = ('/llm_astar/barrier_map', *text[1:])
    fitting, other = barriers.to_grid(), room()
    requests, _ = ask([
        on_topic, map_at(1, fitting), call_at(2, (2, 2), (8, 8), 1),
        map_at(3, other), call_at(4, (2, 2), (8, 8), 2),
    ])  # fmt: skip
    assert [request.barrier_map for request in requests] == [barriers, None]


def test_a_bag_without_a_map_names_the_grids_it_has(ask, tmp_path):
    requests, problems = ask([call_at(1, (2, 2), (8, 8))])
    assert not requests
    assert 'no map: there is no nav_msgs/msg/OccupancyGrid on /map' in problems.left_out[0]
    folder = write_bag(tmp_path / 'other', [map_at(1, room()), call_at(2, (2, 2), (8, 8))])
    with Bag(folder) as bag:
        offer = describe(bag, TopicSelection(map_topic='/robot/map'))
    assert 'name one with --map-topic: /map' in offer['missing']


def test_a_bag_is_described_by_its_topics_and_their_roles(tmp_path):
    folder = write_bag(tmp_path / 'bag', [map_at(1, room()), call_at(2.5, (2, 2), (8, 8))])
    with Bag(folder) as bag:
        offer = describe(bag, TopicSelection())
    assert (offer['messages'], offer['seconds'], offer['missing']) == (2, 1.5, '')
    assert {topic['name']: topic['part'] for topic in offer['topics']} == {
        '/map': 'map',
        EVENT: 'request',
    }
