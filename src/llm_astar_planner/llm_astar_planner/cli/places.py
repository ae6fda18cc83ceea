# Copyright 2026 The LLM-A* for ROS 2 contributors
# SPDX-License-Identifier: Apache-2.0

"""Check the named places of a map, list them and draw them.

The file is GeoJSON in metres of the map's frame: drawn in QGIS, written by hand, or the graph of
nav2_route, whose named nodes are places.

examples:
  llm-astar places depot.places.geojson
  llm-astar places depot.places.geojson --map depot.yaml --png out/places.png
  llm-astar places graph.geojson --json

exit codes: 0 done, also with warnings; 2 a file that cannot be read
"""

from __future__ import annotations

import argparse
import json

from llm_astar_msgs_adapter.maps.places import Places, places_problems

from llm_astar_planner.cli.flags import add_picture_option, option
from llm_astar_planner.cli.map_files import add_map_options, open_maps, open_places, place_to_json
from llm_astar_planner.plugins import find_drawing

HEADINGS = ('name', 'kind', 'tags', 'centre (m)', 'area', 'also called')


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the options."""
    option(parser, 'file FILE', 'GeoJSON file with the places')
    add_map_options(parser.add_argument_group('the map to check them on'))
    output = parser.add_argument_group('output')
    add_picture_option(output, 'draw the places, on the map if it is given')
    option(output, '--json', 'print one JSON object')


def run(arguments: argparse.Namespace) -> int:
    """Check, list and draw places; return 0. Raises PlacesError for a malformed file."""
    drawing = find_drawing('places') if arguments.png else None
    places = open_places(arguments.file, None)
    grid_map = open_maps(arguments, 0)[1].to_grid() if arguments.map else None
    problems = places_problems(places, grid_map) if grid_map else []
    if arguments.json:
        listed = [place_to_json(place) for place in places]
        print(json.dumps({'frame': places.frame_id, 'places': listed, 'problems': problems}))
    else:
        print(places_to_text(places))
        for problem in problems:
            print(f'warning: {problem}')
    if drawing is not None:
        drawing.load()(places, grid_map, arguments.png)
        if not arguments.json:
            print(f'picture: {arguments.png}')
    return 0


def places_to_text(places: Places) -> str:
    """Return a table of places."""
    rows = [HEADINGS]
    for place in places:
        entry = place_to_json(place)
        x, y = entry['centre']
        area = 'point' if entry['area'] is None else f'{entry["area"]:.1f} m²'
        tags, aliases = (', '.join(entry[field]) or '-' for field in ('tags', 'aliases'))
        rows.append((place.name, place.kind, tags, f'{x:.2f}, {y:.2f}', area, aliases))
    widths = [max(map(len, column)) for column in zip(*rows)]
    lines = ['  '.join(map(str.ljust, row, widths)).rstrip() for row in rows]
    count = f'{len(places)} place{"" if len(places) == 1 else "s"} in frame {places.frame_id}'
    return '\n'.join([count, *(lines if len(places) else [])])
