"""Public corpora of sentences with their meaning, read from the folder of LLM_ASTAR_INSTRUCTIONS.

Lang2LTL and the cleanup world (Liu et al., MIT), AutoTAMP's HouseWorld (Chen et al., MIT). Nothing
of them lies in this repository.
"""

import ast
import csv
import json
import os
import re
from functools import cache
from pathlib import Path

import numpy as np
from language import ltlf
from language.judge import Truth
from language.worlds import hall_of_rooms, open_field
from llm_astar_msgs_adapter.maps.places import load_places

ROOMS = (
    'kitchen', 'office', 'library', 'workshop', 'pantry', 'studio', 'chapel', 'archive',
    'laboratory', 'nursery',
)  # fmt: skip
COLOURS = ('red', 'green', 'blue', 'yellow')
# Patterns of Lang2LTL that clauses can say.
SAYABLE = {
    'visit', 'sequenced_visit', 'ordered_visit', 'strictly_ordered_visit', 'global_avoidance',
    'past_avoidance', 'future_avoidance', 'delayed_reaction', 'upper_restricted_avoidance',
    'lower_restricted_avoidance', 'exact_restricted_avoidance',
}  # fmt: skip
# What the tasks of HouseWorld mean, of those that are there.
HOUSE_TASKS = {
    1: 'F & green_bedroom F yellow_bathroom',
    2: '& F & yellow_bathroom F & pink_bedroom F red_bathroom '
    '& F & kitchen F red_bathroom F & dining_room F red_bathroom',
    5: '& F pink_bedroom F dining_room',
    7: '& W ! red_bathroom kitchen & W ! yellow_bathroom kitchen '
    '& G ! living_room G ! exercise_room',
    9: '& W ! pink_bedroom living_room & F kitchen & F red_bathroom & F green_bedroom '
    '& F pink_bedroom & F living_room & F exercise_room & F yellow_bathroom F dining_room',
}


def folder():
    """Return the folder of the corpora, None where there is none."""
    root = os.environ.get('LLM_ASTAR_INSTRUCTIONS')
    path = Path(root) / 'corpora' if root else None
    return path if path is not None and path.is_dir() else None


@cache
def rooms_world():
    """Return the map of rooms for the letters of Lang2LTL."""
    return hall_of_rooms(list(ROOMS))


def lang2ltl():
    """Yield (pattern, sentence, truth) with rooms put in for letters, by a fixed draw."""
    draw = np.random.default_rng(27)
    with (folder() / 'lang2ltl.csv').open(newline='') as file:
        for entry in csv.DictReader(file):
            letters = ast.literal_eval(entry['props'])
            rooms = [ROOMS[index] for index in draw.permutation(len(ROOMS))[: len(letters)]]
            names = dict(zip(letters, rooms))
            formula = ltlf.weakened(ltlf.parse(entry['ltl_formula']))
            regions = {letter: {'place': room} for letter, room in names.items()}
            used = set(ltlf.atoms(formula))
            regions = {letter: region for letter, region in regions.items() if letter in used}
            says = entry['pattern_type'] in SAYABLE
            truth = Truth(formula, regions, says=says)
            yield entry['pattern_type'], with_rooms(entry['utterance'], names), truth


def with_rooms(sentence, names):
    """Put rooms in for the letters of a sentence."""
    words = re.compile(r'\b(?!a (?:single|finite)\b)([a-z])\b(?!\')')
    return words.sub(lambda m: f'the {names[m[1]]}' if m[1] in names else m[0], sentence)


@cache
def cleanup_world():
    """Return a map of four rooms in colours."""
    rooms = [{'name': f'{colour} room', 'tags': [colour]} for colour in COLOURS]
    return hall_of_rooms(rooms)


def cleanup():
    """Yield ('cleanup', sentence, truth)."""
    with (folder() / 'cleanup.csv').open(newline='') as file:
        for sentence, text in list(csv.reader(file))[1:]:
            formula = ltlf.parse(text)
            regions = {atom: {'place': atom.replace('_', ' ')} for atom in ltlf.atoms(formula)}
            yield 'cleanup', sentence, Truth(formula, regions)


def house_world():
    """Return HouseWorld's rooms on an open field."""
    places = load_places(folder() / 'houseworld.places.geojson')
    return open_field(places, (-15.5, -15.5, 15.5, 15.5), [(13.5, -13.5), (0.0, 13.5)])


def houseworld():
    """Yield (task, sentence, truth)."""
    for entry in json.loads((folder() / 'houseworld.json').read_text()):
        formula = ltlf.parse(HOUSE_TASKS[entry['task']])
        regions = {atom: {'place': atom.replace('_', ' ')} for atom in ltlf.atoms(formula)}
        yield f'houseworld {entry["task"]}', entry['sentence'], Truth(formula, regions)
