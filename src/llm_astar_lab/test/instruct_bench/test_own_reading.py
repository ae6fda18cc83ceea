"""The regions and lengths of the benchmark against a reading of the same in code of its own."""

import itertools
import json
from pathlib import Path

import numpy as np
import pytest
import shapely
from llm_astar_lab.instruct_bench.checks import (
    FORMS,
    region_geometry,
    spans_in,
    without_ends,
)
from llm_astar_lab.instruct_bench.maps import Scene
from llm_astar_lab.instruct_bench.suite import load_suite
from llm_astar_planner.instructions.verification.geometry import EDGE, first_from, polyline, total
from own_reading import MeasuredPath, extent, geometry_of

SUITE = Path(__file__).resolve().parents[4] / 'maps/instructions/suite.json'
REGION_FIELDS = ('region', 'first', 'second')
LEFT, RIGHT = {'half': 'left'}, {'half': 'right'}


@pytest.fixture(scope='module')
def scenes():
    """Yield each instruction with its map, start and goal."""
    entries = json.loads(SUITE.read_text(encoding='utf-8'))['instructions']
    return list(zip(entries, load_suite(SUITE).instructions, strict=True))


def regions_of(entry):
    """Yield the regions of an instruction's checks, as JSON."""
    for check in entry['checks']:
        yield from (check[name] for name in REGION_FIELDS if name in check)
        yield from check.get('regions', ())


def both(value, instruction):
    """Return the geometry of a region as the benchmark and as the tests read it."""
    scene = Scene(instruction.suite_map, instruction.start, instruction.goal)
    grid_map = instruction.suite_map.grid_map
    start, goal = grid_map.grid_to_world([instruction.start, instruction.goal])
    own = geometry_of(value, instruction.suite_map, tuple(start), tuple(goal))
    return region_geometry(value, 'region', scene), own


def more_regions(suite_map):
    """Yield regions of every form that any map of the suite has."""
    names = [place.name for place in suite_map.places]
    first, last = {'place': names[0]}, {'place': names[-1]}
    yield from ({'half': side} for side in ('north', 'south', 'east', 'west', 'left', 'right'))
    yield from ({'half': side, 'of': names[0]} for side in ('north', 'south', 'east', 'west'))
    yield from ({'tag': tag} for tag in suite_map.places.tags)
    yield from ({'between': [first, last]}, {'union': [first, last, LEFT]}, first, last)
    yield from ({'near': first, 'width': 1.5}, {'near': RIGHT, 'width': 0.3}, {'walls': 0.4})
    yield from ({'rect': [None, 3, 9, None]}, {'rect': [1, 1, 5, 4]}, {'circle': [5, 4, 2.5]})
    yield {'polygon': [[1, 1], [9, 2], [4, 8]]}


def assert_same(value, instruction):
    ours, own = both(value, instruction)
    frame = shapely.box(*extent(instruction.suite_map.grid_map))
    assert ours.symmetric_difference(own).intersection(frame).area < 1e-6, value


def test_every_region_of_the_suite_lies_where_the_tests_read_it(scenes):
    regions = [
        (value, instruction) for entry, instruction in scenes for value in regions_of(entry)
    ]
    assert len(regions) > 500
    for value, instruction in regions:
        assert_same(value, instruction)


def test_every_form_lies_where_the_tests_read_it_on_every_map(scenes):
    on_maps = {instruction.suite_map.name: instruction for _, instruction in scenes}
    tried = set()
    for instruction in on_maps.values():
        for value in more_regions(instruction.suite_map):
            assert_same(value, instruction)
            tried.add(next(form for form in FORMS if form in value))
    assert tried == set(FORMS)


def test_paths_are_measured_as_the_tests_measure_them(scenes):
    rng = np.random.default_rng(4)
    for entry, instruction in scenes[::3]:
        grid_map = instruction.suite_map.grid_map
        free = np.argwhere(grid_map.cells < 65)
        between = free[rng.integers(len(free), size=rng.integers(6)), ::-1].tolist()
        points = grid_map.grid_to_world([instruction.start, *between, instruction.goal])
        path, own = polyline(points), MeasuredPath(points)
        assert path.length == pytest.approx(own.length)
        for value in itertools.islice(regions_of(entry), 3):
            region, _ = both(value, instruction)
            for geometry in (region, region.buffer(-EDGE, join_style='mitre')):
                spans = spans_in(path, geometry)
                assert total(spans) == pytest.approx(own.length_in(geometry), abs=1e-6)
                after = rng.uniform(0.0, path.length)
                assert first_from(spans, after) == pytest.approx(own.first_touch(geometry, after))
            for ends in (0.0, 1.0, 0.4 * path.length, 0.6 * path.length):
                ours, theirs = (
                    shapely.distance(pieces, region).min(initial=np.inf)
                    for pieces in (without_ends(path, ends), own.without_ends(ends))
                )
                assert ours == pytest.approx(theirs)
