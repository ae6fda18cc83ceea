"""The maps of the page: the user's own first, then the shipped ones."""

import shlex

import pytest
from llm_astar_lab.play.maps import Maps, PlayError
from llm_astar_lab.play.request import command_of, read_request
from llm_astar_planner.cli.main import main

MAP = 'type octile\nheight 4\nwidth 6\nmap\n......\n.@@@@.\n......\n......\n'
SCENARIO = 'version 1\n0\tmy maze.map\t6\t4\t0\t3\t5\t3\t5.0\n'


@pytest.fixture
def maze(tmp_path):
    """A MovingAI map in a file whose name a shell would break apart."""
    (tmp_path / 'my maze.map').write_text(MAP)
    (tmp_path / 'my maze.map.scen').write_text(SCENARIO)
    return str(tmp_path / 'my maze.map')


def test_a_movingai_map_is_offered_with_the_pairs_of_its_scenarios(maze, capsys):
    maps = Maps([maze])
    offered = next(iter(maps))
    assert offered.id == f'{maze}.scen'
    assert not offered.is_metric
    assert (offered.grid_map.width, offered.grid_map.height) == (6, 4)
    [(start, goal)] = offered.pairs()
    request = read_request({'map': offered.id, 'start': [*start], 'goal': [*goal]}, maps)
    command = command_of(request)
    assert "'" in command
    words = shlex.split(command)
    assert main(words[1:]) == 0
    assert '5.00 cells' in capsys.readouterr().out


def test_a_shipped_map_is_taken_by_its_short_name():
    office = next(iter(Maps(['office'])))
    assert office.id == 'office.yaml'
    assert office.is_metric
    assert len(office.places) == 17


def test_the_shipped_maps_follow_and_each_is_listed_once(maze):
    listed = [play_map.id for play_map in Maps([maze, 'demo.json', maze])]
    assert len(listed) == len(set(listed))
    assert listed[:2] == [f'{maze}.scen', 'demo.json:0']
    assert 'instructions/house.yaml' in listed
    assert sum(name.startswith('samples_1000.json:') for name in listed) == 10


def test_a_map_that_is_not_listed_is_named_with_those_that_are():
    with pytest.raises(PlayError, match=r'demo\.json:0') as refused:
        Maps().get('elsewhere.yaml')
    assert refused.value.status == 404
