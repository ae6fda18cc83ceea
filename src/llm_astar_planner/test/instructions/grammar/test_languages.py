import re
from pathlib import Path

import pytest
from instructions.grammar.hospital import read
from llm_astar_planner.instructions.grammar.vocabulary import FOLDER, KINDS
from llm_astar_planner.instructions.interpretation import Understanding

GERMAN = {
    'Bitte die Apotheke meiden': 'avoid the pharmacy',
    'fahre nicht durch die Apotheke, sondern durch den Empfang': 'avoid the pharmacy; '
    'visit the reception',
    'besuche zuerst Station 1 und dann die Apotheke': 'visit the ward 1, then the pharmacy',
    'halte mindestens zwei Meter Abstand zu den Wänden': 'keep 2 m away from the walls',
    'halte dich 1,5 m von allen Türen fern': 'keep 1.5 m away from all door places',
    'betritt Station 1 erst nach der Apotheke': 'do not enter the ward 1 before the pharmacy',
    'besuche die Apotheke, bevor du Station 1 betrittst': 'do not enter the ward 1 '
    'before the pharmacy',
    'besuche Station zwei': 'visit the ward 2',
    'meide wenn möglich alle Badezimmer': 'if possible, avoid all bathroom places',
    'die Apotheke ist gesperrt': 'avoid the pharmacy',
    'bleib auf der linken Seite': 'if possible, stay in the left side of the direct way',
    'halte dich auf der Südseite': 'if possible, stay in the south half',
    'bleibe in der nördlichen Hälfte': 'stay in the north half',
    'besuche die Apotheke oder den Empfang': 'visit either the pharmacy or the reception',
    'nimm den Flur': 'if possible, stay in the hallway',
    'ende am Empfang': 'end in the reception',
    'vergiss nicht, die Apotheke zu besuchen': 'visit the pharmacy',
    'vermeide es, durch die Apotheke zu fahren': 'avoid the pharmacy',
    'fahr um den Scanner im Norden herum': 'pass the scanner on the north side',
    'fahre links am Scanner vorbei': 'pass the scanner on the left of the direct way',
    'betrete weder die Apotheke noch den Empfang': 'avoid the pharmacy; avoid the reception',
    'fahr zur Apotheke, ohne den Flur zu betreten': 'visit the pharmacy; avoid the hallway',
}
FRENCH = {
    'évite la pharmacie si possible': 'if possible, avoid the pharmacy',
    "n'entre pas dans la pharmacie": 'avoid the pharmacy',
    'ne traverse pas la pharmacie': 'avoid the pharmacy',
    "passe d'abord par la pharmacie, puis par la réception": 'visit the pharmacy, '
    'then the reception',
    'reste du côté nord': 'if possible, stay in the north half',
    'reste dans la moitié sud': 'stay in the south half',
    'reste à au moins 2 m des murs': 'keep 2 m away from the walls',
    'termine dans la pharmacie': 'end in the pharmacy',
    'va à la réception sans passer par la pharmacie': 'visit the reception; avoid the pharmacy',
    "n'entre pas dans la pharmacie avant d'avoir visité la réception": 'do not enter '
    'the pharmacy before the reception',
    "contourne le scanner par l'est": 'pass the scanner on the east side',
    'la pharmacie est fermée': 'avoid the pharmacy',
    'laisse le scanner à ta gauche': 'pass the scanner on the right of the direct way',
    'visite la pharmacie ou la réception': 'visit either the pharmacy or the reception',
    'évite toutes les portes': 'avoid all door places',
}
SPANISH = {
    'evita la farmacia': 'avoid the pharmacy',
    'no pases por la farmacia': 'avoid the pharmacy',
    'pasa por la farmacia y luego por la recepción': 'visit the pharmacy, then the reception',
    'mantente en el lado norte': 'if possible, stay in the north half',
    'mantente a dos metros de las paredes': 'keep 2 m away from the walls',
    'termina en la farmacia': 'end in the pharmacy',
    'si es posible, evita todas las puertas': 'if possible, avoid all door places',
    'no entres en la farmacia antes de visitar la recepción': 'do not enter the pharmacy '
    'before the reception',
    'pasa al norte del scanner': 'pass the scanner on the north side',
    'mantente al sur de y = 10': 'avoid the area with y above 10',
    'visita la farmacia o la recepción': 'visit either the pharmacy or the reception',
    'no olvides visitar la farmacia': 'visit the pharmacy',
}
WHOLE = {**GERMAN, **FRENCH, **SPANISH}


@pytest.mark.parametrize('text', WHOLE)
def test_is_read_wholly(text):
    interpretation = read(text)
    assert interpretation.sentence == WHOLE[text], interpretation.detail
    assert interpretation.status is Understanding.WHOLE


@pytest.mark.parametrize(
    'text',
    [
        'wenn die Tür offen ist, fahre durch die Apotheke',
        'du musst die Apotheke nicht besuchen',
        'du brauchst nicht in die Apotheke zu fahren',
        "tu n'as pas besoin de visiter la pharmacie",
        'no hace falta que visites la farmacia',
        'no tienes que visitar la farmacia',
    ],
)
def test_what_may_mean_something_else_makes_no_clause(text):
    assert read(text).specification.enforceable == ()


@pytest.mark.parametrize(
    'text', ['Beeil dich bitte, wir sind spät dran', 'Dépêche-toi !', '¡Date prisa, por favor!']
)
def test_a_sentence_about_something_else_asks_nothing(text):
    assert read(text).status is Understanding.IRRELEVANT


def test_the_sets_of_kinds_of_words_are_those_that_are_asked_for():
    modules = Path(FOLDER).parents[1].rglob('*.py')
    asked = {name for one in modules for name in re.findall(r'KINDS\.(\w+)', one.read_text())}
    assert asked == set(vars(KINDS))
    with pytest.raises(AttributeError, match=r'kinds\.yaml has no set .verb.'):
        KINDS.verb  # noqa: B018
