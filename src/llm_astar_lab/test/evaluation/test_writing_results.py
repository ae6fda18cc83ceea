"""The bag of an evaluation's plans, read by the mcap library."""

import json

import numpy as np
import pytest
from llm_astar_lab.bags.types import MAP
from llm_astar_lab.bags.writing import BagWriteError
from llm_astar_lab.evaluation.writing import ResultsBag
from llm_astar_msgs_adapter.maps.grid_map import GridMap
from llm_astar_planner.planning.planner import Planner
from llm_astar_planner.planning.types import PlanRequest, plan_report
from llm_astar_planner.waypoints.source import WaypointReply
from mcap.reader import make_reader
from mcap_ros2.decoder import DecoderFactory

SECOND = 1_000_000_000


class TwoPoints:
    name = 'two points'

    def waypoints(self, query):
        return WaypointReply(((5.0, 5.0), (90.0, 90.0)), label=self.name)


def free_map(width):
    return GridMap(np.zeros((20, width), dtype=np.int8), resolution=0.5)


def evaluate(bag, grid_map, stamp, source=None, goal=(12, 12)):
    plan = Planner(grid_map).plan(PlanRequest((2, 2), goal, 'llm_astar', source))
    points = grid_map.grid_to_world(plan.path)
    label = source.name if source else 'none'
    bag.add('llm_astar', label, grid_map, stamp, points=points, report=plan_report(plan, grid_map))
    return plan, points


def read(folder):
    with next(folder.glob('*.mcap')).open('rb') as stream:
        reader = make_reader(stream, validate_crcs=True, decoder_factories=[DecoderFactory()])
        return [
            (channel.topic, message.log_time, value)
            for _, channel, message, value in reader.iter_decoded_messages()
        ]


def test_each_plan_is_a_path_a_report_and_markers_and_each_map_is_written_once(tmp_path):
    with ResultsBag(tmp_path / 'bag') as bag:
        plan, points = evaluate(bag, free_map(30), 5 * SECOND)
        evaluate(bag, free_map(30), 5 * SECOND, TwoPoints())
        evaluate(bag, free_map(40), 6 * SECOND)
    messages = read(tmp_path / 'bag')
    guided = [f'/evaluation/llm_astar_two_points/{kind}' for kind in ('plan', 'report', 'markers')]
    alone = [f'/evaluation/llm_astar/{kind}' for kind in ('plan', 'report', 'markers')]
    assert [topic for topic, _, _ in messages] == [MAP, *alone, *guided, MAP, *alone]
    stamps = [stamp for _, stamp, _ in messages]
    assert stamps == sorted(stamps)
    path, report = (value for _, _, value in messages[1:3])
    assert np.allclose([(p.pose.position.x, p.pose.position.y) for p in path.poses], points)
    assert path.header.frame_id == 'map'
    assert path.header.stamp.sec == report.header.stamp.sec == 5
    values = {item.key: json.loads(item.value) for item in report.status[0].values}
    assert (values['code'], values['length']) == (0, pytest.approx(plan.length * 0.5))
    marker = messages[6][2].markers[0]
    assert [(point.x, point.y) for point in marker.points] == [(2.75, 2.75), (45.25, 45.25)]
    assert marker.colors[0].g > marker.colors[0].r
    assert marker.colors[1].r > marker.colors[1].g


def test_a_request_without_a_plan_is_an_empty_path_and_a_report(tmp_path):
    with ResultsBag(tmp_path / 'bag', 'mcap') as bag:
        evaluate(bag, free_map(30), SECOND, goal=(50, 50))
    _, (_, _, path), (_, _, report), _ = read(tmp_path / 'bag')
    assert path.poses == []
    assert '[GOAL_OUTSIDE_MAP 204]' in report.status[0].message


def test_an_evaluation_that_fails_leaves_a_readable_bag(tmp_path):
    def break_off():
        with ResultsBag(tmp_path / 'bag') as bag:
            evaluate(bag, free_map(30), SECOND)
            raise RuntimeError

    with pytest.raises(RuntimeError):
        break_off()
    assert len(read(tmp_path / 'bag')) == 4
    assert (tmp_path / 'bag' / 'metadata.yaml').is_file()
    with pytest.raises(BagWriteError, match='exists already'):
        ResultsBag(tmp_path / 'bag')
