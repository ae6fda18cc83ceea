"""The files that the commands of the documentation take for granted, of our own making."""

import json

import numpy as np
from llm_astar_msgs_adapter.maps.barrier_map import load_barrier_maps
from llm_astar_planner.resources import find_file
from llm_astar_planner.waypoints.source import SourceStatus
from llm_astar_planner.waypoints.transcript import Exchange, TranscriptWriter
from PIL import Image

RESOLUTION = 0.05
ORIGIN = (-7.14, -7.83)
# Racks of the depot as (x, y, width, height) in cells; every aisle is over 1 m wide.
RACKS = [(70 + 90 * column, y, 50, 26) for column in range(6) for y in (60, 100, 164, 216)]
PLACES = {
    'dock': (20, 20, 30, 30),
    'workbench': (552, 262, 30, 30),
    'tables': (340, 100, 50, 26),
    'pallets': (250, 164, 50, 26),
}


def write_depot(folder):
    """Write depot.yaml, depot.pgm and depot.places.geojson: 604 x 307 cells of 0.05 m."""
    picture = np.full((307, 604), 254, dtype=np.uint8)
    picture[:3] = picture[-3:] = picture[:, :3] = picture[:, -3:] = 0
    for x, y, width, height in RACKS:
        picture[y : y + height, x : x + width] = 0
    Image.fromarray(picture[::-1]).save(folder / 'depot.pgm')
    (folder / 'depot.yaml').write_text(
        f'image: depot.pgm\nmode: trinary\nresolution: {RESOLUTION}\n'
        f'origin: [{ORIGIN[0]}, {ORIGIN[1]}, 0.0]\nnegate: 0\n'
        'occupied_thresh: 0.65\nfree_thresh: 0.196\n'
    )
    features = [
        {'type': 'Feature', 'properties': {'name': name},
         'geometry': {'type': 'Polygon', 'coordinates': [corners(*box)]}}
        for name, box in PLACES.items()
    ]  # fmt: skip
    places = {'type': 'FeatureCollection', 'frame_id': 'map', 'features': features}
    (folder / 'depot.places.geojson').write_text(json.dumps(places))


def corners(x, y, width, height):
    """Return the closed outline of a box of cells, in metres."""
    cells = [(x, y), (x + width, y), (x + width, y + height), (x, y + height), (x, y)]
    return [[round(at * RESOLUTION + o, 3) for at, o in zip(cell, ORIGIN)] for cell in cells]


def write_movingai(folder):
    """Write x.map and x.map.scen: ten pairs on an empty map, with their optimal lengths."""
    rows = '\n'.join('.' * 40 for _ in range(20))
    (folder / 'x.map').write_text(f'type octile\nheight 20\nwidth 40\nmap\n{rows}\n')
    pairs = [f'0\tx.map\t40\t20\t0\t{y}\t30\t{y}\t30' for y in range(10)]
    (folder / 'x.map.scen').write_text('\n'.join(['version 1', *pairs]) + '\n')


def write_transcript(path):
    """Write a model's answers to all queries of samples_1000.json: the goal itself."""
    writer = TranscriptWriter(path)
    for barrier_map in load_barrier_maps(find_file('samples_1000.json', 'maps')):
        for pair, sample in enumerate(barrier_map.samples):
            text = f'Generated Path: [{list(sample.goal)}]'
            query = (barrier_map.id, pair, 1, 'parrot', 'few_shot', (), text)
            writer.write(Exchange(*query, 7, 5, 0.1, SourceStatus.OK))
