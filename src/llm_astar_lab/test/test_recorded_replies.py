"""The table of two real language models, against a recomputation that shares no code with it.

The recorded replies, the published counts of A* and the maps are read as plain JSON; means,
shares, validity and what is wrong with a reply are computed here again.
"""

import csv
import gzip
import json
import math
import os
import random
import re
from itertools import pairwise
from pathlib import Path

import pytest
from llm_astar_planner.cli.main import main

REFERENCE = os.environ.get('LLM_ASTAR_REFERENCE')
pytestmark = pytest.mark.skipif(not REFERENCE, reason='LLM_ASTAR_REFERENCE is not set')
# What the README of the recorded replies says of this half: operation, storage, length of LLM-A*
# over the paper's A* in percent, and how often the waypoints alone are a valid path.
PUBLISHED = {
    'none': (32.38, 53.28, 101.7, None),
    'oracle': (29.15, 51.48, 101.23, 60),
    'qwen2.5:1.5b': (64.42, 80.23, 102.35, 10),
    'llama3.2:3b': (100.06, 102.72, 103.02, 6),
}
EXAMPLES = [
    [[5, 5], [26, 9], [25, 23], [20, 20]], [[2, 3], [11, 6], [18, 8]],
    [[40, 20], [31, 15], [20, 3], [10, 10]], [[4, 4], [16, 16]],
    [[25, 25], [21, 7], [10, 6], [4, 4]],
]  # fmt: skip
RATIOS = ('operation', 'storage', 'length')


@pytest.fixture(scope='module')
def folder():
    return Path(REFERENCE)


@pytest.fixture(scope='module')
def out(folder, tmp_path_factory):
    """Run the benchmark on both transcripts."""
    out = tmp_path_factory.mktemp('replies') / 'out'
    files = ','.join(str(folder / 'replies' / f'{name}.jsonl') for name in ('qwen', 'llama'))
    words = ['bench', '--map', folder / 'barrier_maps_00_49.json', '--source', 'replay,oracle']
    words += ['--transcript', files, '--methods', 'llm_astar,guided,waypoints_only']
    assert main([*map(str, words), '--out', str(out)]) == 0
    return out


@pytest.fixture(scope='module')
def rows(out):
    """Return the rows of results.csv by method, model or source, and sample."""
    found = {}
    with (out / 'results.csv').open() as file:
        for row in csv.DictReader(file):
            of = found.setdefault((row['method'], row['model'] or row['source']), {})
            of[int(row['map']), int(row['pair'])] = row
    return found


@pytest.fixture(scope='module')
def cases(out):
    summary = json.loads((out / 'summary.json').read_text())
    return {(case['method'], case['model'] or case['source']): case for case in summary['cases']}


@pytest.fixture(scope='module')
def astar(folder):
    """Return the published counts of A* by sample."""
    with gzip.open(folder / 'golden_maps_00_49.json.gz', 'rt') as file:
        records = json.load(file)['records']
    return {(record['map'], record['pair']): record['astar'] for record in records}


@pytest.fixture(scope='module')
def maps(folder):
    return {entry['id']: entry for entry in json.loads(
        (folder / 'barrier_maps_00_49.json').read_text()
    )}  # fmt: skip


@pytest.fixture(scope='module')
def replies(folder):
    """Return the lines of each transcript by model."""
    found = {}
    for name in ('qwen', 'llama'):
        lines = (folder / 'replies' / f'{name}.jsonl').read_text().splitlines()
        records = [json.loads(line) for line in lines]
        found[records[0]['model']] = records
    return found


def last_list(text):
    """Return the last list of points in a reply, up to where it was cut."""
    found = re.findall(r'\[(?:\s*\[-?\d+, -?\d+[\])],?)+', text)
    if not found:
        return []
    return [[int(x), int(y)] for x, y in re.findall(r'\[(-?\d+), (-?\d+)[\])]', found[-1])]


def walls_of(entry):
    """Return the barriers of a map and its outermost lines as segments (x0, y0, x1, y1)."""
    (x0, x1), (y0, y1) = entry['range_x'], entry['range_y']
    walls = [(a, y, b, y) for y, a, b in entry['horizontal_barriers']]
    walls += [(x, a, x, b) for x, a, b in entry['vertical_barriers']]
    right, top = x1 - 1, y1 - 1
    return walls + [
        (x0, y0, right, y0), (x0, top, right, top), (x0, y0, x0, top), (right, y0, right, top),
    ]  # fmt: skip


def touch(a, b, c, d):
    """Tell whether the segments ab and cd have a point in common, in whole numbers."""

    def side(p, q, r):
        value = (q[0] - p[0]) * (r[1] - p[1]) - (q[1] - p[1]) * (r[0] - p[0])
        return (value > 0) - (value < 0)

    def within(p, q, r):
        return all(min(p[i], q[i]) <= r[i] <= max(p[i], q[i]) for i in (0, 1))

    sides = side(a, b, c), side(a, b, d), side(c, d, a), side(c, d, b)
    if sides[0] != sides[1] and sides[2] != sides[3]:
        return True
    ends = ((a, b, c), (a, b, d), (c, d, a), (c, d, b))
    return any(on == 0 and within(*three) for on, three in zip(sides, ends))


def is_free(points, walls):
    return not any(touch(a, b, wall[:2], wall[2:]) for a, b in pairwise(points) for wall in walls)


def geometric_mean(values):
    return math.exp(sum(map(math.log, values)) / len(values))


@pytest.mark.parametrize('name', PUBLISHED)
@pytest.mark.parametrize('method', ['llm_astar', 'guided'])
def test_the_ratios_are_those_over_the_published_counts(rows, cases, astar, name, method):
    of_variant = rows[method, name]
    assert len(of_variant) == 60
    for place, metric in enumerate(RATIOS):
        by_map = {}
        for (number, pair), row in of_variant.items():
            ratio = float(row[metric]) / astar[number, pair][metric]
            by_map.setdefault(number, []).append(ratio)
        expected = geometric_mean([ratio for ratios in by_map.values() for ratio in ratios])
        found = cases[method, name][metric]
        assert found['value'] == pytest.approx(expected, rel=1e-8)
        if method == 'llm_astar':
            assert round(100 * expected, 2) == PUBLISHED[name][place]
        low, high = bootstrap(by_map)
        assert (found['low'], found['high']) == pytest.approx((low, high), rel=0.05)


def bootstrap(by_map):
    """Return the middle 95 % of the geometric means over maps drawn with replacement."""
    draw = random.Random(7)  # noqa: S311 - no secret
    groups = list(by_map.values())
    means = sorted(
        geometric_mean([ratio for group in draw.choices(groups, k=len(groups)) for ratio in group])
        for _ in range(1000)
    )
    return means[25], means[974]


@pytest.mark.parametrize('name', PUBLISHED)
@pytest.mark.parametrize('method', ['llm_astar', 'guided'])
def test_the_share_of_optimal_paths_is_that_of_paths_as_short_as_the_published(
    rows, cases, astar, name, method
):
    optimal = sum(
        float(row['length']) <= astar[sample]['length'] * (1 + 1e-9)
        for sample, row in rows[method, name].items()
    )
    assert cases[method, name]['optimal'] == pytest.approx(optimal / 60)


@pytest.mark.parametrize('name', ['qwen2.5:1.5b', 'llama3.2:3b'])
def test_waypoints_alone_are_valid_where_their_lines_touch_no_barrier(
    rows, cases, maps, replies, name
):
    valid = set()
    for record in replies[name]:
        entry = maps[record['map']]
        start, goal = entry['start_goal'][record['pair']][:2]
        points = last_list(record['response'])
        inner = [point for point in points if point not in (start, goal)]
        if points and is_free([start, *inner, goal], walls_of(entry)):
            valid.add((record['map'], record['pair']))
    assert len(valid) == PUBLISHED[name][3]
    found = {key for key, row in rows['waypoints_only', name].items() if row['code'] == 'NONE'}
    assert found == valid
    assert cases['waypoints_only', name]['valid']['value'] == len(valid) / 60


@pytest.mark.parametrize('name', ['qwen2.5:1.5b', 'llama3.2:3b'])
def test_what_is_wrong_with_each_reply_is_counted_again(rows, cases, maps, replies, name):
    counts = dict.fromkeys(
        ('no_list', 'cut', 'wrong_start_or_goal', 'off_map', 'example_repeated', 'in_prompt'), 0
    )
    for record in replies[name]:
        entry = maps[record['map']]
        start, goal = entry['start_goal'][record['pair']][:2]
        points, is_cut = last_list(record['response']), record['completion_tokens'] == 256
        problems = {
            'no_list': not points,
            'cut': is_cut,
            'wrong_start_or_goal': bool(points)
            and (points[0] != start or (points[-1] != goal and not is_cut)),
            'off_map': any(
                not (0 <= x < entry['range_x'][1] and 0 <= y < entry['range_y'][1])
                for x, y in points
            ),
            'example_repeated': points in EXAMPLES,
            'in_prompt': any([start, goal] == [route[0], route[-1]] for route in EXAMPLES),
        }
        said = rows['llm_astar', name][record['map'], record['pair']]['reply_problems'].split(';')
        said += ['wrong_start_or_goal'] if {'wrong_start', 'wrong_goal'} & {*said} else []
        assert {key for key, has in problems.items() if has} == {*said} & {*problems}, record
        for key, has in problems.items():
            counts[key] += has
    found = cases['llm_astar', name]['replies']
    assert {key: found.get(key, 0) for key in counts} == counts
    # Of the parse failures published for both halves, these lie on this one.
    assert (counts['no_list'], counts['cut']) == {'q': (1, 0), 'l': (0, 6)}[name[0]]
    assert found['replies'] == 60
    assert counts['in_prompt'] == 2
    seconds = sorted(record['seconds'] for record in replies[name])
    middle = (seconds[29] + seconds[30]) / 2
    assert cases['llm_astar', name]['seconds_reply']['median'] == pytest.approx(middle)
    tokens = sum(record['completion_tokens'] for record in replies[name])
    assert cases['llm_astar', name]['completion_tokens'] == tokens


def test_the_samples_that_are_not_recorded_are_listed(out):
    summary = json.loads((out / 'summary.json').read_text())
    assert [(item['transcript'], item['recorded']) for item in summary['replays']] == [
        ('qwen.jsonl', 60), ('llama.jsonl', 60),
    ]  # fmt: skip
    assert summary['replays'][0]['missing'][:2] == [
        {'maps': '0-2', 'pairs': '0-9', 'scale': 1},
        {'maps': '3-4', 'pairs': '1-4,6-9', 'scale': 1},
    ]
