"""A small suite on two rooms with a door, written as its own files, and changed at will."""

import copy
import json

import numpy as np
from PIL import Image

# 12 m x 6 m at 0.5 m, two rooms; the wall at x from 6 to 6.5 has doors at y 1 to 2 and 4 to 5.
ROOMS = np.zeros((12, 24), dtype=bool)
ROOMS[:, 12] = True
ROOMS[[2, 3, 8, 9], 12] = False
MAPS = {
    'rooms': {
        'places': {
            'west room': {'polygon': [[0, 0], [6, 0], [6, 6], [0, 6]], 'aliases': ['left room']},
            'east room': {'polygon': [[6.5, 0], [12, 0], [12, 6], [6.5, 6]], 'tags': ['blue']},
            'south door': {'polygon': [[6, 1], [6.5, 1], [6.5, 2], [6, 2]], 'kind': 'door'},
            'north door': {'polygon': [[6, 4], [6.5, 4], [6.5, 5], [6, 5]], 'kind': 'door'},
            'desk': {'polygon': [[9, 4.5], [10, 4.5], [10, 5.5], [9, 5.5]]},
            'vault': {'polygon': [[6, 2.5], [6.5, 2.5], [6.5, 3.5], [6, 3.5]]},
        }
    }
}


def via(name):
    return {'clauses': [{'kind': 'visit', 'regions': [{'place': name}], 'strength': 'must'}]}


def avoid(name):
    return {'clauses': [{'kind': 'avoid', 'region': {'place': name}, 'strength': 'must'}]}


INSTRUCTIONS = [
    {
        'id': 'door',
        'map': 'rooms',
        'start': [2, 1.5],
        'goal': [10, 1.5],
        'text': 'go through the north door',
        'lang': 'en',
        'style': 'templated',
        'expect': 'ok',
        'spec': via('north door'),
        'accept': [avoid('south door')],
        'checks': [{'check': 'touch', 'region': {'place': 'north door'}, 'clause': 0}],
    },
    {
        'id': 'tür',
        'map': 'rooms',
        'start': [2, 1.5],
        'goal': [10, 1.5],
        'text': 'meide die Südtür',
        'lang': 'de',
        'style': 'free',
        'writer': 'ann',
        'spec': avoid('south door'),
        'checks': [{'check': 'inside_max', 'region': {'place': 'south door'}, 'metres': 0.1}],
    },
    {
        'id': 'vault',
        'map': 'rooms',
        'start': [2, 1.5],
        'goal': [10, 1.5],
        'text': 'visit the vault',
        'expect': 'impossible',
        'spec': via('vault'),
        'checks': [{'check': 'touch', 'region': {'place': 'vault'}, 'tol': -0.1}],
    },
    {
        'id': 'both',
        'map': 'rooms',
        'start': [2, 1.5],
        'goal': [10, 1.5],
        'text': 'visit the desk and do not enter the desk',
        'expect': 'contradiction',
        'spec': {'clauses': [*via('desk')['clauses'], *avoid('desk')['clauses']]},
        'checks': [
            {'check': 'touch', 'region': {'place': 'desk'}, 'clause': 0},
            {'check': 'inside_max', 'region': {'place': 'desk'}, 'metres': 0.0, 'clause': 1},
        ],
    },
    {
        'id': 'hurry',
        'map': 'rooms',
        'start': [2, 1.5],
        'goal': [10, 1.5],
        'text': 'hurry up',
        'expect': 'none',
        'spec': {'clauses': []},
        'checks': [{'check': 'length_max', 'of_direct': 1.05}],
    },
]
SUITE = {'version': 1, 'maps': MAPS, 'instructions': INSTRUCTIONS}


def write_rooms(folder, name='rooms'):
    """Write the map_server yaml and image of the rooms."""
    pixels = np.where(ROOMS[::-1], 0, 254).astype(np.uint8)
    Image.fromarray(pixels).save(folder / f'{name}.png')
    fields = ('resolution: 0.5', 'origin: [0, 0, 0]', 'occupied_thresh: 0.65', 'free_thresh: 0.25')
    yaml = folder / f'{name}.yaml'
    yaml.write_text('\n'.join([f'image: {name}.png', 'negate: 0', *fields]) + '\n')
    return yaml


def write_suite(folder, change=None, suite=SUITE):
    """Write the suite with its map; `change` edits a copy of it first. Return its path."""
    write_rooms(folder)
    made = copy.deepcopy(suite)
    if change is not None:
        change(made)
    path = folder / 'suite.json'
    path.write_text(json.dumps(made))
    return path
