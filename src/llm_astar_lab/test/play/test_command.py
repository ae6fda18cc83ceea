"""The command that the page shows makes the page's plan again."""

import json
import shlex

import pytest
from llm_astar_planner.cli.main import main
from llm_astar_planner.search.methods import METHODS

HOUSE = 'instructions/house.yaml'
ASKED = {
    'pair of a barrier map': {'source': 'random'},
    'a map of a file with several': {'map': 'demo.json:1', 'start': [6, 22], 'goal': [41, 5]},
    'a via point': {'via': [[30, 8], [20, 3]], 'method': 'exact_astar'},
    'a reply': {'reply': '-> "Generated Path": [[31, 10], [27, 9], [12, 9]]'},
    'a robot': {'map': HOUSE, 'robot_radius': 0.15, 'source': 'embedded', 'any_angle': True},
    'rules': {'map': HOUSE, 'corner_cutting': True, 'max_suboptimality': 1.0, 'source': 'coarse'},
    'an instruction': {'map': HOUSE, 'instruction': 'avoid the hall'},
    'a reading': {'map': HOUSE, 'instruction': 'avoid the kitchin', 'confirm': True},
    'a heuristic': {'method': 'weighted_astar', 'heuristic': 'octile', 'weight': 1.3},
    **{method: {'method': method, 'source': 'oracle'} for method in METHODS},
}


@pytest.mark.parametrize('fields', ASKED.values(), ids=ASKED)
def test_the_command_gives_the_same_path_with_the_same_work(page, capsys, fields):
    body = {'map': 'demo.json:0', 'start': [39, 18], 'goal': [7, 19]}
    if fields.get('map') == HOUSE:
        body |= page.get('/api/map', params={'id': HOUSE}).json()['pairs'][0]
    reply = page.post('/api/plan', json=body | fields).json()
    words = shlex.split(reply['command'])
    assert words[0] == 'llm-astar'
    assert main([*words[1:], '--json']) == 0
    printed = json.loads(capsys.readouterr().out)
    shown = reply['plans'][0]
    assert printed['operation'] == shown['operation']
    assert printed['length'] == shown['length']
    assert printed['path'] == shown['path']
    assert [point['verdict'] for point in printed['waypoints']] == [
        status for *_, status in shown['waypoints']
    ]
