"""Public corpora of sentences with their meaning, read from the folder of LLM_ASTAR_INSTRUCTIONS.

Lang2LTL and the cleanup world (Liu et al., MIT), AutoTAMP's HouseWorld (Chen et al., MIT). Nothing
of them lies in this repository.
"""

import ast
import csv
import functools
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
    """Yield (pattern, sentence, truths) with rooms put in for letters, by a fixed draw."""
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
            text = with_rooms(entry['utterance'], names)
            truths = (Truth(formula, regions, says=says),)
            rest, last = without_last_visit(formula)
            if rest is not None and is_only_forbidden(names[last], text):
                used = set(ltlf.atoms(rest))
                kept = {letter: region for letter, region in regions.items() if letter in used}
                truths += (Truth(rest, kept, says=says),)
            yield entry['pattern_type'], text, truths


def without_last_visit(formula):
    """Return a conjunction without the visit of a single place in it, and the place; or None."""
    parts = conjuncts(formula)
    visits = [part for part in parts if part[0] == 'F' and isinstance(part[1], str)]
    if len(visits) != 1 or len(parts) == 1:
        return None, ''
    rest = [staying(part) for part in parts if part != visits[0]]
    return functools.reduce(lambda one, two: ('&', one, two), rest), visits[0][1]


def staying(formula):
    """Return a formula by which a way may end in a place that is stayed in until something."""
    if isinstance(formula, str):
        return formula
    head, *parts = formula
    is_stay = head == 'U' and isinstance(parts[0], str)
    return ('W' if is_stay else head, *map(staying, parts))


def conjuncts(formula):
    """Return the parts of a conjunction."""
    if isinstance(formula, tuple) and formula[0] == '&':
        return [*conjuncts(formula[1]), *conjuncts(formula[2])]
    return [formula]


def is_only_forbidden(room, sentence):
    """Tell whether a sentence names a room only to forbid it: 'do not go to b until you see a'.

    The corpus says of some of these that the room is visited in the end, of others that it is not.
    """
    parts = re.split(r'[.,;]| and (?:then )?(?=do |you |never )', sentence)
    named = [part.strip() for part in parts if re.search(rf'\b{room}\b', part)]
    return all(
        re.match(r"do no\b|do not\b|don't\b|never\b|you (cannot|can't|must not)\b", part)
        for part in named
    )


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
    """Yield ('cleanup', sentence, truths)."""
    with (folder() / 'cleanup.csv').open(newline='') as file:
        for sentence, text in list(csv.reader(file))[1:]:
            formula = ltlf.parse(text)
            regions = {atom: {'place': atom.replace('_', ' ')} for atom in ltlf.atoms(formula)}
            yield 'cleanup', sentence, (Truth(formula, regions),)


def house_world():
    """Return HouseWorld's rooms on an open field."""
    places = load_places(folder() / 'houseworld.places.geojson')
    return open_field(places, (-15.5, -15.5, 15.5, 15.5), [(13.5, -13.5), (0.0, 13.5)])


def houseworld():
    """Yield (task, sentence, truths)."""
    for entry in json.loads((folder() / 'houseworld.json').read_text()):
        formula = ltlf.parse(HOUSE_TASKS[entry['task']])
        regions = {atom: {'place': atom.replace('_', ' ')} for atom in ltlf.atoms(formula)}
        yield f'houseworld {entry["task"]}', entry['sentence'], (Truth(formula, regions),)
