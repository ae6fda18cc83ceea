"""What the operator is shown is read back as the same specification."""

import math

import pytest
import shapely
from hypothesis import assume, given, settings
from hypothesis import strategies as st
from llm_astar_msgs_adapter.maps.places import Place, Places
from llm_astar_planner.instructions.clauses.avoid import Avoid
from llm_astar_planner.instructions.clauses.before import Before
from llm_astar_planner.instructions.clauses.clause import MUST, SHOULD
from llm_astar_planner.instructions.clauses.count import MAX_ENTRIES, Count
from llm_astar_planner.instructions.clauses.end_at import EndAt
from llm_astar_planner.instructions.clauses.keep_distance import KeepDistance
from llm_astar_planner.instructions.clauses.never_after import NeverAfter
from llm_astar_planner.instructions.clauses.pass_by import Pass
from llm_astar_planner.instructions.clauses.stay_in import StayIn
from llm_astar_planner.instructions.clauses.then import Then
from llm_astar_planner.instructions.clauses.unknown import Unknown
from llm_astar_planner.instructions.clauses.unsupported import ABOUT, Unsupported
from llm_astar_planner.instructions.clauses.visit import Visit
from llm_astar_planner.instructions.grammar.interpreter import GrammarInterpreter
from llm_astar_planner.instructions.interpretation import Understanding
from llm_astar_planner.instructions.regions import (
    COMPASS,
    ENDS,
    SIDES,
    WALLS,
    AllOf,
    Along,
    AnyOf,
    Between,
    Box,
    Disc,
    End,
    Except,
    Half,
    NamedPlace,
    Tagged,
)
from llm_astar_planner.instructions.specification import Specification
from llm_astar_planner.instructions.text import MAX_INSTRUCTION_CHARS

NAMES = (
    'kitchen',
    'loading dock',
    'rack A',
    'wall x=17',
    'door between kitchen and lab',
    'lab',
    'north aisle',
    'Müller office',
    'room 12',
    'bus stop',
    'upper pallet row',
    'waiting-room 2',
)
TAGS = ('blue', 'staff only', 'bathroom', 'quiet')
PLACES = Places(
    Place(
        name,
        shapely.box(4 * n, 3 * (n % 3), 4 * n + 3, 3 * (n % 3) + 2),
        kind='room',
        tags=(TAGS[n % 4], TAGS[(n + 1) % 4]),
    )
    for n, name in enumerate(NAMES)
)

names = st.sampled_from(NAMES)
coordinates = st.integers(-99_999, 99_999).map(lambda n: n / 100)
lengths = st.integers(1, 9_999).map(lambda n: n / 100)


@st.composite
def boxes(draw):
    limits = []
    for _ in range(2):
        low, high = sorted(
            draw(st.tuples(coordinates, coordinates).filter(lambda p: p[0] != p[1]))
        )
        opened = draw(st.sampled_from(('no', 'low', 'high', 'both')))
        limits.append(
            (
                -math.inf if opened in ('low', 'both') else low,
                math.inf if opened in ('high', 'both') else high,
            )
        )
    (x0, x1), (y0, y1) = limits
    return Box(x0, y0, x1, y1)


simple = st.one_of(
    names.map(NamedPlace),
    st.sampled_from(TAGS).map(Tagged),
    st.builds(Disc, coordinates, coordinates, st.just(0.0) | lengths),
    boxes(),
    st.sampled_from(SIDES).map(Half),
    st.builds(Half, st.sampled_from(COMPASS), names),
    st.builds(Between, names, names),
    st.builds(Along, names | st.just(WALLS), lengths),
    st.sampled_from(ENDS).map(End),
)


def joined(parts):
    several = st.lists(parts, min_size=2, max_size=3, unique=True).map(tuple)
    return st.one_of(
        several.map(AnyOf),
        several.map(AllOf),
        st.builds(Except, parts, st.lists(parts, min_size=1, max_size=2, unique=True).map(tuple)),
    )


regions = simple | joined(simple) | joined(simple | joined(simple))
limits = st.tuples(st.integers(0, MAX_ENTRIES), st.none() | st.integers(0, MAX_ENTRIES)).filter(
    lambda pair: pair[1] is None or pair[0] <= pair[1]
)
common = {'strength': st.sampled_from((MUST, SHOULD))}
clauses = st.one_of(
    st.builds(Avoid, **common, region=regions, margin=st.just(0.0) | lengths),
    st.builds(Visit, **common, regions=st.lists(regions, min_size=1, max_size=2).map(tuple)),
    st.builds(Before, **common, first=regions, second=regions),
    st.builds(StayIn, **common, region=regions),
    st.builds(Pass, **common, region=regions, side=st.sampled_from(SIDES)),
    st.builds(KeepDistance, **common, metres=lengths, region=st.none() | regions),
    st.builds(EndAt, **common, region=regions),
    st.builds(Then, **common, first=regions, second=regions),
    st.builds(NeverAfter, **common, first=regions, second=regions),
    st.builds(
        lambda strength, region, pair: Count(strength, '', region, *pair),
        common['strength'],
        regions,
        limits,
    ),
    st.builds(
        Unsupported, text=st.sampled_from(('slowly', 'by noon')), about=st.sampled_from(ABOUT)
    ),
    st.builds(Unknown, text=st.sampled_from(('hm', 'if it rains; avoid the lab', 'x, y and z'))),
)


def read(sentence):
    return GrammarInterpreter().interpret(sentence, PLACES, 1.0)


@given(clauses)
@settings(max_examples=200, deadline=None)
def test_a_clause_is_read_back(clause):
    sentence = Specification((clause,)).sentence
    assume(len(sentence) <= MAX_INSTRUCTION_CHARS)
    assert read(sentence).specification == Specification((clause,)), sentence


@given(st.lists(clauses, min_size=2, max_size=4).map(lambda some: Specification(tuple(some))))
@settings(max_examples=100, deadline=None)
def test_a_specification_is_read_back(specification):
    sentence = specification.sentence
    assume(len(sentence) <= MAX_INSTRUCTION_CHARS)
    interpretation = read(sentence)
    assert interpretation.specification == specification, sentence
    if not any(clause.kind == Unknown.kind for clause in specification.clauses):
        assert interpretation.status is Understanding.WHOLE


def test_everything_that_is_not_understood_stays_so():
    specification = Specification((Avoid(region=NamedPlace('lab')), Unknown(text='the rest')))
    interpretation = read(specification.sentence)
    assert interpretation.specification == specification
    assert interpretation.status is Understanding.PARTLY


@pytest.mark.parametrize('name', NAMES)
def test_each_name_is_read(name):
    assert read(f'avoid the {name}').sentence == f'avoid the {name}'
