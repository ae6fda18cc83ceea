"""The simulator and the measures of missions in Nav2; a mission where Nav2 is installed."""

import json
import math
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
import shapely
from llm_astar_msgs_adapter.maps.grid_map import GridMap, Pose2D
from nav2_stack import places, processes
from nav2_stack.measures import length, median_ratio, pairs, turning
from nav2_stack.table import write_table
from nav2_stack.world import ACCELERATION, PERIOD, ROBOT_RADIUS, SWING, World, off_by

FOLDER = Path(__file__).parent
BOX = (3.0, 2.0, 0.5, 1.0)


@pytest.fixture
def hall():
    """A hall of 10 x 6 m with a box in it, and the robot at (1, 3)."""
    cells = np.zeros((120, 200), dtype=np.int8)
    cells[[0, -1]] = cells[:, [0, -1]] = 100
    world = World(GridMap(cells, resolution=0.05, origin=Pose2D(-1.0, -2.0, 0.0)))
    world.put('boxes', BOX)
    world.robot.pose = Pose2D(1.0, 1.0, 0.0)
    return world


def drive(world, speed, turn, seconds, step=1 / 30):
    for _ in range(round(seconds / step)):
        world.step(speed, turn, step)
    return world.robot.pose


def test_a_robot_that_drives_and_turns_follows_a_circle(hall):
    hall.robot.speed, hall.robot.turn = 0.5, 1.0
    pose = drive(hall, 0.5, 1.0, 1.0)
    assert pose.x == pytest.approx(1.0 + 0.5 * math.sin(1.0), abs=1e-9)
    assert pose.y == pytest.approx(1.0 + 0.5 * (1.0 - math.cos(1.0)), abs=1e-9)
    assert pose.yaw == pytest.approx(1.0)


def test_a_robot_gains_speed_no_faster_than_it_can(hall):
    drive(hall, 1.0, 0.0, 0.2)
    assert hall.robot.speed == pytest.approx(0.2 * ACCELERATION)
    drive(hall, 1.0, 0.0, 0.5)
    assert hall.robot.speed == 1.0


def test_a_robot_stops_at_a_wall_and_may_leave_it_again(hall):
    hall.robot.pose = Pose2D(1.0, 2.5, 0.0)
    pose = drive(hall, 1.0, 0.0, 5.0)
    assert 3.0 - ROBOT_RADIUS - 0.06 < pose.x < 3.0 - ROBOT_RADIUS + 0.06
    assert hall.bumps > 0
    assert drive(hall, -0.5, 0.0, 1.0).x < pose.x - 0.2


def test_the_laser_measures_what_shapely_does(hall):
    hall.robot.pose = Pose2D(1.21, 1.07, 0.4)
    x, y, yaw = hall.robot.pose
    walls = shapely.box(-0.95, -1.95, 8.95, 3.95).boundary
    walls = shapely.union(walls, shapely.box(3.0, 2.0, 3.5, 3.0))
    ranges = hall.scan(beams=90, longest=20.0)
    for number, measured in enumerate(ranges):
        angle = yaw - math.pi + number * 2.0 * math.pi / 90
        ray = shapely.LineString([(x, y), (x + 20 * math.cos(angle), y + 20 * math.sin(angle))])
        assert shapely.distance(shapely.intersection(ray, walls), shapely.Point(x, y)) == (
            pytest.approx(measured, abs=1e-3)
        )


def test_the_laser_sees_nothing_beyond_its_range(hall):
    assert np.isinf(hall.scan(longest=0.5)).all()


def test_a_box_that_is_taken_away_is_free_again(hall):
    assert hall.clearance(3.2, 2.5) == 0.0
    hall.put('boxes')
    assert hall.clearance(3.2, 2.5) > 1.0


def test_length_and_turning_of_a_track():
    track = [(0, 0, 3.0), (3, 4, -3.0), (3, 5, -2.5)]
    assert length(track) == pytest.approx(6.0)
    assert turning(track) == pytest.approx(2 * math.pi - 6.0 + 0.5)


def test_a_robot_is_localized_off_by_the_error_where_it_is():
    pose = Pose2D(12.0, -5.0, 0.7)
    x, y, yaw = off_by(Pose2D(0.05, -0.02, 0.02), pose)
    seen = complex(x, y) + complex(pose.x, pose.y) * np.exp(1j * yaw)
    assert seen == pytest.approx(complex(12.05, -5.02))
    assert yaw + pose.yaw == pytest.approx(0.72)


def measured(planner, mission, **values):
    row = {
        'noise': 0.0,
        'planner': planner, 'map': 'depot', 'scenario': 'plain', 'mission': mission, 'seed': 1,
        'arrived': True, 'status': 4, 'code': 0, 'seconds': 10.0, 'driven': 8.0, 'planned': 8.0,
        'turning': 1.0, 'near': 0.0, 'bumps': 0, 'recoveries': 0, 'plans': 9, 'collisions': 0,
        'first_plan_ms': 20.0, 'warned': [], 'load': 1.0,
        'cpu': {'planner_server': 1.0}, 'memory': {'planner_server': 80.0},
    }  # fmt: skip
    return {**row, **values}


def test_ratios_are_of_pairs_that_both_arrived():
    rows = [measured('navfn', n) for n in range(3)]
    rows += [measured('ours', 0, driven=6.0), measured('ours', 1, driven=4.0, arrived=False)]
    both = pairs(rows, 'ours', 'navfn')
    assert len(both) == 2
    assert median_ratio(both, 'driven') == 0.75


def test_the_table_has_both_planners_and_their_ratios(tmp_path):
    rows = [measured('ours', 0, driven=6.0), measured('navfn', 0)]
    rows[0]['cpu']['planner_node'], rows[0]['memory']['planner_node'] = 0.5, 200.0
    lines = '\n'.join(json.dumps(row) for row in rows)
    (tmp_path / 'missions.jsonl').write_text(lines)
    write_table(tmp_path, tmp_path / 'page.md', 'python -m nav2_stack', 'today')
    page = (tmp_path / 'page.md').read_text()
    assert '| | planner_node | NavFn |' in page
    assert 'driven 0.750' in page
    assert '1.5 s (planner_server 1.0, planner_node 0.5) | 1.0 s |' in page


def test_drives_of_another_setting_have_a_section_of_their_own(tmp_path):
    rows = [measured(planner, 0) for planner in ('ours', 'navfn')]
    rows += [{**row, 'noise': 0.06, 'driven': 2.0 * row['driven']} for row in rows]
    assert len(pairs(rows, 'ours', 'navfn')) == 2
    (tmp_path / 'missions.jsonl').write_text('\n'.join(map(json.dumps, rows)))
    write_table(tmp_path, tmp_path / 'page.md', 'python -m nav2_stack', 'today')
    page = (tmp_path / 'page.md').read_text()
    assert '| arrived | as NavFn | 1 (1) |' in page
    assert '## depot: plain missions, localized off by 6 cm\n' in page


@pytest.mark.parametrize('name', ['depot', 'warehouse'])
def test_missions_are_the_same_for_the_same_seed(name):
    grid_map = places.find_map(name)
    first, again = (places.missions(grid_map, 'plain', 5) for _ in range(2))
    assert first == again
    world = World(grid_map)
    assert all(world.clearance(*mission.goal[:2]) > 0.5 for mission in first)
    assert all(places.connected(world, mission.start, mission.goal) for mission in first)


def test_boxes_that_move_swing_about_their_places_and_wait_for_the_robot():
    world = World(places.depot())
    boxes = [(3.0, 3.0, 0.5, 0.5), (9.0, 3.0, 0.5, 0.5)]
    world.robot.pose = Pose2D(9.25 + SWING, 3.25, 0.0)
    for seconds in np.linspace(0.0, PERIOD, 9):
        world.swing('boxes', boxes, seconds)
        (x, y, *_), (other, *_) = world.boxes['boxes']
        assert x == 3.0
        assert y == pytest.approx(3.0 + SWING * math.sin(2.0 * math.pi * seconds / PERIOD))
        assert world.clearance(*world.robot.pose[:2]) > 0.0
        assert other < 9.0 + SWING


def test_boxes_and_a_shut_door_leave_a_way():
    grid_map = places.depot()
    mission = places.missions(grid_map, 'boxes', 1)[0]
    world = World(grid_map)
    world.put('boxes', *mission.boxes)
    assert len(mission.boxes) == 14
    assert places.connected(world, mission.start, mission.goal)
    world.put('boxes')
    world.put('door', places.DOOR_BOX)
    through = places.missions(grid_map, 'door', 1)[0]
    assert places.connected(world, through.start, through.goal)


@pytest.mark.skipif(not processes.has_nav2(), reason=processes.MISSING)
def test_a_robot_arrives_in_nav2_without_a_recovery_or_a_warning(tmp_path):
    command = [sys.executable, '-m', 'nav2_stack', '--planners', 'ours', '--maps', 'depot']
    options = ['--scenarios', 'plain=1', '--out', str(tmp_path)]
    subprocess.run([*command, *options], cwd=FOLDER, check=True)
    (line,) = (tmp_path / 'missions.jsonl').read_text().splitlines()
    row = json.loads(line)
    assert row['arrived']
    assert row['recoveries'] == row['bumps'] == 0
    assert row['warned'] == []
