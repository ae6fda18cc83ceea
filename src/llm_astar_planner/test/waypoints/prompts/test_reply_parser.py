"""The reply parser: every shape models produce, and nothing that can hurt."""

import random
import string

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from llm_astar_planner.waypoints.prompts.reply_parser import (
    MAX_REPLY_CHARS,
    MAX_WAYPOINTS,
    parse_reply,
)

HOSTILE = (
    '[1, 2]' + '#' * 5000 + '\nX[3, 4]',
    '[1, 2]' + '//' * 5000 + '\nX[3, 4]',
    '[1, 2]' + '1.' * 5000 + 'X[3, 4]',
    '[1, 2]' + ' to then' * 5000 + 'X[3, 4]',
    '[[1, 2],' * 8000,
    'Selected Point: ' * 4000 + '[1, 2]',
    '```\n' * 20000,
    '```a' * 20000,
    '{"x": ' * 10000,
    '{"x": 1, "y": 2}' * 5000,
    '[' * 10**6,
    '[1,' * 10**5,
    '(1, 2)' * 10**5,
    '9' * 10**6,
    '{"a":' * 10**5,
    '{"a":' * 900 + '1' + '}' * 900,
    '{"path":[' + '{"a":' * 900 + '[1, 2]' + '}' * 900 + ']}',
)
PATH = ((5.0, 5.0), (26.0, 9.0), (20.0, 20.0))


@pytest.mark.parametrize(
    'text',
    [
        'Generated Path: [[5, 5], [26, 9], [20, 20]]',
        '[[5, 5], [26, 9], [20, 20]]',
        'Sure! Here it is:\n```json\n[[5, 5], [26, 9], [20, 20]]\n```\n',
        'Sure:\n```\nGenerated Path: [[5, 5], [26, 9], [20, 20]]\n```\nIt avoids [10, 0, 25].',
        '**Generated Path:** [(5, 5), (26, 9), (20, 20)]',
        'Generated Path: [[5.0, 5.0], [26.0, 9.00], [2e1, 20.]]',
        'Generated Path: (5, 5) -> (26, 9) -> (20, 20)',
        'Generated Path: [5, 5], [26, 9], [20, 20]',
        'The path:\n1. (5, 5)\n2. (26, 9)\n3. (20, 20)\n',
        '{"path": [[5, 5], [26, 9], [20, 20]]}',
        '{"start": [5, 5], "goal": [20, 20], "waypoints": [[5, 5], [26, 9], [20, 20]]}',
        '{"waypoints": [{"x": 5, "y": 5}, {"x": 26, "y": 9}, {"x": 20, "y": 20}]}',
        'Answer: [{"x": 5, "y": 5}, {"x": 26, "y": 9}, {"x": 20, "y": 20}] as asked',
        '{"steps": [{"point": [5, 5], "why": "start"}, {"point": [26, 9], "why": "corner"},'
        ' {"point": [20, 20], "why": "goal"}]}',
        '[[5, 5], # the start\n [26, 9], # round the corner\n [20, 20]]',
        'Path: [[5, 5] (start), [26, 9] (corner), [20, 20] (goal)]',
        'Horizontal Barriers: [[10, 0, 25]]\nGenerated Path: [[5, 5], [26, 9], [20, 20]]',
        'Generated Path: [[5, 5], [26, 9], [20, 20]]\nVertical Barriers: [[25, 10, 22]]',
        'First [[2, 2], [3, 3]].\nFinal: Generated Path: [[5, 5], [26, 9], [20, 20]] Done.',
        '<think>maybe [[1, 1], [2, 2]]</think>Generated Path: [[5, 5], [26, 9], [20, 20]]',
        '<think>[[5, 5], [26, 9], [20, 20]]</think>I cannot conclude.',
        'Generated Path: [[5, 5, 0], [26, 9, 0], [20, 20, 0]]',
        'Generated Path: [["5", "5"], ["26", "9"], ["20", "20"]]',
        'Path: [(x=5, y=5), (x=26, y=9), (x=20, y=20)]',
        'Generated Path: \uff085\uff0c5\uff09, \uff0826\uff0c9\uff09, \uff0820\uff0c20\uff09',
        'Go from [5, 5] to [26, 9] then [20, 20].',
        'Selected Point: [5, 5]\nEvaluation: fine.\n**Selected Point:** [26, 9]\n'
        'Evaluation: near [1, 1]\n- Selected Point: (20, 20)\n',
    ],
)
def test_every_shape_of_the_same_path(text):
    assert parse_reply(text) == PATH


@pytest.mark.parametrize(
    ('text', 'waypoints'),
    [
        ('Generated Path: [[5, 5], [26, 9], [2', PATH[:2]),
        ('{"path": [[5, 5], [26, 9], [20,', PATH[:2]),
        ('{"waypoints": [{"x": 5, "y": 5}, {"x": 26, "y": 9}, {"x": 2', PATH[:2]),
        ('```json\n[[5, 5], [26, 9], ', PATH[:2]),
        ('Generated Path: [[5, 5], [nan, 3], [1e999, 2], [26, 9], [Infinity, 1]]', PATH[:2]),
        ('Generated Path: [[5, 5], [1e300, 3], [26, 9], [1, -1e13]]', PATH[:2]),
        ('[[5, 5], [NaN, 3], [26, 9], [Infinity, 1]]', PATH[:2]),
        ('Generated Path: [[5, 5], [20 - 7.5, 7], [abc, 9], [26, 9]]', PATH[:2]),
        ('Generated Path: [[12, 7], [abc, 9]]', ((12.0, 7.0),)),
        ('Generated Path: [[-3, 400], [12.5, -0.5]]', ((-3.0, 400.0), (12.5, -0.5))),
        ('Generated Path: [26, 9]', ((26.0, 9.0),)),
    ],
)
def test_points_that_are_cut_off_or_not_numbers_are_left_out(text, waypoints):
    assert parse_reply(text) == waypoints


@pytest.mark.parametrize(
    'text',
    ['Generated Path: []', '[]', '{"path": []}', 'Generated Path: [[]]', '**Path**: [ ]'],
)
def test_an_empty_list_is_an_answer(text):
    assert parse_reply(text) == ()


@pytest.mark.parametrize(
    'text',
    [
        '',
        'no path found',
        'I cannot help with that.',
        'Generated Path: [',
        'Horizontal Barriers: [[10, 0, 25], [15, 30, 50]]\nVertical Barriers: []',
        '{"horizontal_barriers": [[10, 0, 25]], "vertical_barriers": []}',
        'Generated Path: [[abc, def]]',
        '__import__("os").system("true")',
        'The start [5, 5] is blocked.',
        '{"x": "1" * 3}',
        '[true, false]',
    ],
)
def test_text_without_a_list_of_points(text):
    assert parse_reply(text) is None


def test_the_number_of_points_and_the_length_of_text_are_bounded():
    many = 'Generated Path: [' + ', '.join(f'[{i}, {i}]' for i in range(500)) + ']'
    assert parse_reply(many) == tuple((float(i), float(i)) for i in range(MAX_WAYPOINTS))
    long = 'Generated Path: [[1, 1], [2, 2]]' + ' ' * MAX_REPLY_CHARS
    assert parse_reply(long) is None
    for hostile in HOSTILE:
        assert len(parse_reply(hostile) or ()) <= MAX_WAYPOINTS


PIECES = [
    '[', ']', '(', ')', '{', '}', ',', ', ', ':', '"', "'", '\n', ' ', '-', '->', '.', 'e', 'x',
    'y', '"x": ', '"y": ', 'Generated Path: ', 'Selected Point: ', '```json\n', '```', 'nan',
    'Infinity', '1e999', '<think>', '</think>', '[[5, 5], [26, 9]]', '[10, 0, 25]', '\\', '#',
    '//', '{"path": ', '\x00', '\ud800', '\uff0c', '9' * 400,
]  # fmt: skip


def fuzz(n: int, seed: int) -> int:
    """Parse n replies glued from pieces that models write; return how many held points."""
    rng = random.Random(seed)  # noqa: S311 - a reproducible test
    found = 0
    for _ in range(n):
        pieces = [
            rng.choice(PIECES) if rng.random() < 0.7 else rng.choice(string.printable)
            for _ in range(rng.randrange(60))
        ]
        pieces += [str(rng.randrange(-60, 60)) for _ in range(rng.randrange(20))]
        rng.shuffle(pieces)
        points = parse_reply(''.join(pieces)) or ()
        assert len(points) <= MAX_WAYPOINTS
        assert all(x - x == 0 and y - y == 0 for x, y in points)
        found += bool(points)
    return found


def test_fuzz():
    assert fuzz(5000, seed=0) > 100


@pytest.mark.slow
def test_fuzz_for_long():
    assert fuzz(100_000, seed=1) > 2000


@settings(max_examples=100, deadline=None)
@given(st.lists(st.one_of(st.sampled_from(PIECES), st.text(max_size=8)), max_size=80))
def test_any_text_parses(pieces):
    points = parse_reply(''.join(pieces))
    assert points is None or len(points) <= MAX_WAYPOINTS


@settings(max_examples=200, deadline=None)
@given(
    st.lists(
        st.tuples(
            st.floats(-1e6, 1e6, allow_nan=False).map(lambda v: round(v, 3)), st.integers(-99, 99)
        ),
        min_size=1,
        max_size=MAX_WAYPOINTS,
    )
)
def test_a_list_of_points_survives_a_round_trip(points):
    text = f'Thinking about [[0, 0]].\nGenerated Path: {[list(point) for point in points]}\nBye.'
    assert parse_reply(text) == tuple((float(x), float(y)) for x, y in points)
