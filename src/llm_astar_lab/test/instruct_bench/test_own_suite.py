"""The suite of route instructions in maps/instructions is sound: truth, checks, balance."""

import json
from collections import Counter
from functools import cache
from itertools import chain
from pathlib import Path

import pytest
from llm_astar_lab.instruct_bench.suite import load_suite
from llm_astar_msgs_adapter.maps.map_server import load_map
from llm_astar_msgs_adapter.maps.places import load_places
from llm_astar_planner.cli.main import main
from llm_astar_planner.costmap.costmap import Costmap
from llm_astar_planner.instructions.clauses.clause import SHOULD
from llm_astar_planner.instructions.regions import (
    Along,
    Between,
    Half,
    NamedPlace,
    Tagged,
    leaves,
)
from llm_astar_planner.instructions.specification import CLAUSES, from_json

FOLDER = Path(__file__).resolve().parents[4] / 'maps' / 'instructions'
SUITE = json.loads((FOLDER / 'suite.json').read_text(encoding='utf-8'))
INSTRUCTIONS = SUITE['instructions']
MEETABLE = [entry for entry in INSTRUCTIONS if entry['expect'] == 'ok']
# Which checks can tell whether a path satisfies a clause.
CHECKS_OF = {
    'avoid': {'inside_max', 'cross'},
    'visit': {'touch', 'order'},
    'before': {'visit_before'},
    'then': {'visit_after'},
    'never_after': {'never_after'},
    'count': {'entries'},
    'stay_in': {'outside_max', 'cross'},
    'pass': {'cross'},
    'keep_distance': {'dist_min', 'wall_dist_min'},
    'end_at': {'end_in'},
}


@cache
def map_and_places(name):
    entry = SUITE['maps'][name]
    return Costmap(load_map(FOLDER / entry['file'])), load_places(FOLDER / entry['places_file'])


def readings(entry):
    return [from_json(spec) for spec in (entry['spec'], *entry['accept'])]


def names_of(region):
    match region:
        case NamedPlace(name):
            return [name]
        case Between(first, second):
            return [first, second]
        case Half(of=name) | Along(place=name):
            return [name] if name not in ('', 'walls') else []
    return []


def test_there_are_enough_instructions_on_enough_maps():
    assert len(INSTRUCTIONS) >= 320
    per_map = Counter(entry['map'] for entry in INSTRUCTIONS)
    assert set(per_map) == set(SUITE['maps'])
    assert len(per_map) >= 8
    assert min(per_map.values()) >= 20
    assert any(map_and_places(name)[0].grid_map.origin.yaw for name in per_map)


def test_the_benchmark_reads_the_suite():
    suite = load_suite(FOLDER / 'suite.json')
    assert [item.id for item in suite.instructions] == [entry['id'] for entry in INSTRUCTIONS]


def test_ids_are_unique_and_so_are_the_texts_of_a_map():
    assert len({entry['id'] for entry in INSTRUCTIONS}) == len(INSTRUCTIONS)
    assert len({(entry['map'], entry['text']) for entry in INSTRUCTIONS}) == len(INSTRUCTIONS)


@pytest.mark.parametrize('name', SUITE['maps'])
def test_starts_and_goals_are_free_and_connected(name):
    costmap, _ = map_and_places(name)
    for entry in INSTRUCTIONS:
        if entry['map'] == name:
            cells = [costmap.grid_map.world_to_cell(*entry[end]) for end in ('start', 'goal')]
            first, second = (costmap.components[y, x] for x, y in cells)
            assert first == second != 0, entry['id']


@pytest.mark.parametrize('entry', INSTRUCTIONS, ids=lambda entry: entry['id'])
def test_the_truth_can_be_read_and_its_places_exist(entry):
    _, places = map_and_places(entry['map'])
    truth, *_ = specifications = readings(entry)
    assert bool(truth.enforceable) == (entry['expect'] != 'none')
    for clause in chain.from_iterable(spec.clauses for spec in specifications):
        for region in chain.from_iterable(map(leaves, clause.regions)):
            for name in names_of(region):
                assert getattr(places.get(name), 'name', None) == name
            if isinstance(region, Tagged):
                assert places.with_tag(region.tag)


@pytest.mark.parametrize('entry', MEETABLE, ids=lambda entry: entry['id'])
def test_every_clause_has_a_check_of_its_kind(entry):
    kinds = {check['check'] for check in entry['checks']}
    for clause in from_json(entry['spec']).clauses:
        assert kinds & CHECKS_OF[clause.kind]


def test_the_checks_of_a_clause_are_of_its_kind():
    for entry in INSTRUCTIONS:
        for check in entry['checks']:
            if 'clause' in check:
                kind = entry['spec']['clauses'][check['clause']]['kind']
                assert check['check'] in CHECKS_OF[kind], entry['id']


def test_few_are_met_by_the_direct_path():
    assert sum(entry['already'] for entry in MEETABLE) < 0.1 * len(MEETABLE)


def test_half_is_templated_and_half_written_freely():
    styles = Counter(entry['style'] for entry in INSTRUCTIONS)
    assert set(styles) == {'templated', 'free'}
    assert min(styles.values()) >= 0.4 * len(INSTRUCTIONS)


def test_the_languages_are_balanced():
    languages = Counter(entry['lang'] for entry in INSTRUCTIONS)
    assert set(languages) == {'en', 'de', 'fr', 'es'}
    assert 0.6 <= languages['en'] / len(INSTRUCTIONS) <= 0.75
    assert min(languages.values()) >= 0.08 * len(INSTRUCTIONS)


def test_the_clauses_are_balanced():
    clauses = [clause for entry in MEETABLE for clause in from_json(entry['spec']).clauses]
    kinds = Counter(clause.kind for clause in clauses)
    assert set(kinds) == set(CLAUSES) - {'unknown', 'unsupported'}
    assert min(kinds.values()) >= 20
    assert sum(clause.strength == SHOULD for clause in clauses) >= 30
    sizes = Counter(len(entry['spec']['clauses']) for entry in MEETABLE)
    assert sizes[2] >= 60
    assert sizes[3] >= 15


def test_what_cannot_be_met_and_what_asks_nothing_is_there():
    expected = Counter(entry['expect'] for entry in INSTRUCTIONS)
    assert expected['impossible'] >= 25
    assert expected['contradiction'] >= 10
    assert expected['none'] >= 20
    tags = Counter(tag for entry in INSTRUCTIONS for tag in entry['tags'])
    assert tags['hostile'] >= 8
    assert tags['misspelt'] >= 8


@pytest.mark.slow
def test_the_planner_satisfies_the_whole_truth(capsys):
    suite = str(FOLDER / 'suite.json')
    assert main(['instruct-bench', '--suite', suite, '--source', 'truth', '--json']) == 0
    figures = json.loads(capsys.readouterr().out)['truth']['all']
    shares = [figures[name] for name in ('exact', 'satisfied', 'recognised')]
    assert all(share['count'] == share['of'] > 0 for share in shares)
