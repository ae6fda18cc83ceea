"""`llm-astar mcp --graph`: an agent asks about the map and the places of a running planner."""

import json
import os
import sys

import pytest
from graph_tools import calling, in_this_process, set_parameter

anyio = pytest.importorskip('anyio')
pytest.importorskip('mcp.server.mcpserver', reason='the extra mcp is not installed')
rclpy = pytest.importorskip('rclpy')

from mcp.client import Client  # noqa: E402 - after the check that it is installed
from mcp.client.stdio import StdioServerParameters, stdio_client  # noqa: E402

SPACE = '/agents'
CORNERS = [[11.5, 5.5], [18.5, 5.5], [18.5, 9.5], [11.5, 9.5], [11.5, 5.5]]
LAB = {
    'type': 'Feature',
    'geometry': {'type': 'Polygon', 'coordinates': [CORNERS]},
    'properties': {'name': 'lab'},
}


async def ask(before, after, change):
    """Return the answers to calls in one session, some of them after a change."""
    environment = dict(os.environ) | {'PYTHONPATH': os.pathsep.join(sys.path)}
    words = ['-m', 'llm_astar_planner.cli.main', 'mcp', '--graph', '--namespace', SPACE]
    command = StdioServerParameters(command=sys.executable, args=words, env=environment)
    async with Client(stdio_client(command)) as client:
        answers = [await client.call_tool(*call) for call in before]
        await anyio.to_thread.run_sync(change)
        return answers + [await client.call_tool(*call) for call in after]


def test_an_agent_asks_about_what_a_running_planner_has(tmp_path):
    places = tmp_path / 'places.geojson'
    places.write_text(json.dumps({'type': 'FeatureCollection', 'features': [LAB]}))
    rclpy.init()
    overrides = ['-p', f'places_file:={places}', '-p', 'use_waypoints:=false']
    route = {'start': [39, 18], 'goal': [7, 19]}
    try:
        with (
            in_this_process('map_node', namespace=SPACE),
            in_this_process('planner_node', *overrides, namespace=SPACE),
            calling(SPACE) as caller,
        ):
            caller.wait_until_ready()

            def grow():
                assert set_parameter(caller, 'planner_node', 'robot_radius', 4.0).successful

            listed, understood, planned, checked, unknown, thin, grown = anyio.run(
                ask,
                [
                    ('list_places', {}),
                    ('interpret', {'text': 'avoid the lab'}),
                    ('plan_route', route | {'instruction': 'visit the lab'}),
                    ('check_path', {'points': [[39, 18], [39, 12]]}),
                    ('plan_route', route | {'goal': 'nowhere'}),
                    ('plan_route', route),
                ],
                [('plan_route', route)],
                grow,
            )
    finally:
        rclpy.try_shutdown()
    assert [place['name'] for place in listed.structured_content['places']] == ['lab']
    assert understood.structured_content['sentence'] == 'avoid the lab'
    report = planned.structured_content['instruction']
    assert (report['satisfied'], report['interpretation']['understood_by']) == (True, 'grammar')
    assert checked.structured_content['drivable'] is True
    assert unknown.is_error
    assert 'there is lab' in unknown.content[0].text
    # A larger robot takes another way.
    assert thin.structured_content['path'] != grown.structured_content['path']
