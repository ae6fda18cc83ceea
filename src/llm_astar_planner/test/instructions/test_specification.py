import json
import math
from pathlib import Path

import pytest
from llm_astar_planner.instructions import specification as module
from llm_astar_planner.instructions.clauses.avoid import Avoid
from llm_astar_planner.instructions.clauses.before import Before
from llm_astar_planner.instructions.clauses.clause import SHOULD
from llm_astar_planner.instructions.clauses.end_at import EndAt
from llm_astar_planner.instructions.clauses.keep_distance import KeepDistance
from llm_astar_planner.instructions.clauses.pass_by import Pass
from llm_astar_planner.instructions.clauses.stay_in import StayIn
from llm_astar_planner.instructions.clauses.unknown import Unknown
from llm_astar_planner.instructions.clauses.visit import Visit
from llm_astar_planner.instructions.fields import SpecificationError
from llm_astar_planner.instructions.regions import (
    FORMS,
    JOINS,
    Along,
    Between,
    Box,
    Disc,
    Half,
    NamedPlace,
    Tagged,
)
from llm_astar_planner.instructions.specification import (
    CLAUSES,
    MAX_CLAUSES,
    MAX_VISITS,
    Specification,
    from_json,
)

SCHEMA = 'route_spec.schema.json'

EVERYTHING = {
    'avoid the kitchen': Avoid(region=NamedPlace('kitchen')),
    'avoid all bathroom places by 2 m': Avoid(region=Tagged('bathroom'), margin=2.0),
    'avoid the area with x from 1 to 2 and y above 22.5': Avoid(
        region=Box(1.0, 22.5, 2.0, math.inf)
    ),
    'visit the lab and the 2 m around the point 1, 2 in any order': Visit(
        regions=(NamedPlace('lab'), Disc(1.0, 2.0, 2.0))
    ),
    'if possible, do not enter the lab before the dock': Before(
        strength=SHOULD, first=NamedPlace('dock'), second=NamedPlace('lab')
    ),
    'stay in the north half of the lab': StayIn(region=Half('north', 'lab')),
    'stay in the left side of the direct way': StayIn(region=Half('left')),
    'pass the rack A on the south side': Pass(region=NamedPlace('rack A'), side='south'),
    'keep 2 m away from the walls': KeepDistance(metres=2.0),
    'keep 0.5 m away from the 1 m along the lab': KeepDistance(metres=0.5, region=Along('lab')),
    'end in the gap between the lab and the dock': EndAt(region=Between('lab', 'dock')),
    'not understood: "hm"': Unknown(text='hm'),
}


@pytest.mark.parametrize('clause', EVERYTHING.values(), ids=list(EVERYTHING))
def test_a_clause_survives_json(clause):
    specification = Specification((clause,))
    assert from_json(json.loads(json.dumps(specification.to_json()))) == specification


@pytest.mark.parametrize('sentence', EVERYTHING)
def test_the_canonical_sentence_says_the_clause(sentence):
    assert Specification((EVERYTHING[sentence],)).sentence == sentence


def test_successive_visits_are_one_part_of_the_sentence():
    visits = tuple(Visit(regions=(NamedPlace(name),)) for name in ('dock', 'workshop'))
    assert Specification(visits).sentence == 'visit the dock, then the workshop'


def test_the_spellings_of_models_are_read():
    read = from_json({'clauses': [{'kind': 'via', 'region': 'lab', 'strength': 'must'}]})
    assert read == Specification((Visit(regions=(NamedPlace('lab'),)),))


@pytest.mark.parametrize(
    ('clause', 'named'),
    [
        ({'kind': 'fly'}, 'kind'),
        ({'kind': 'avoid'}, 'clause 1 .avoid.: region'),
        ({'kind': 'avoid', 'region': {'place': ''}}, 'place'),
        ({'kind': 'avoid', 'region': {'box': [1, 1, 1, 5]}}, 'box'),
        ({'kind': 'avoid', 'region': {'point': [1, math.nan]}}, 'point'),
        ({'kind': 'avoid', 'region': {'point': [1, True]}}, 'point'),
        ({'kind': 'pass', 'region': 'lab', 'side': 'up'}, 'side'),
        ({'kind': 'keep_distance', 'from': 'walls', 'metres': 0}, 'metres'),
        ({'kind': 'visit', 'region': 'lab', 'strength': 'maybe'}, 'strength'),
        ('avoid', 'clause 1: is not an object'),
    ],
)
def test_an_error_names_the_clause_and_the_field(clause, named):
    with pytest.raises(SpecificationError, match=named):
        from_json({'clauses': [clause]})


def test_sizes_are_bounded():
    with pytest.raises(SpecificationError, match='17 clauses'):
        Specification((Unknown(text='x'),) * (MAX_CLAUSES + 1))
    with pytest.raises(SpecificationError, match='9 regions'):
        Specification((Visit(regions=(NamedPlace('lab'),)),) * (MAX_VISITS + 1))


def test_the_published_schema_has_each_kind_of_clause_and_each_form_of_a_region():
    schema = json.loads(Path(module.__file__).with_name(SCHEMA).read_text())
    clauses = schema['properties']['clauses']['items']['oneOf']
    assert {clause['properties']['kind']['const'] for clause in clauses} == set(CLAUSES)
    regions = schema['$defs']['region']['oneOf']
    assert {region['required'][0] for region in regions} == {*FORMS, *JOINS}
