"""Free sentences for the training: those written for this, and halves of public corpora.

The written ones are `test/language/written.json`; by a hash of a map's name half of the maps are
for training, the others are locked: they calibrate and report. The corpora are read from the
folder of LLM_ASTAR_INSTRUCTIONS where it is set.
"""

from __future__ import annotations

import json
import sys
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any

from llm_astar_msgs_adapter.maps.places import Places
from llm_astar_planner.instructions.grammar.vocabulary import nouns
from llm_astar_planner.instructions.grammar.words import phrase_words
from llm_astar_planner.instructions.reader.lifting import lifted
from llm_astar_planner.instructions.reader.meaning import UNKNOWN, Unreadable
from llm_astar_planner.instructions.reader.translation import Translation

sys.path.insert(0, str(Path(__file__).resolve().parents[2] / 'test'))
from language import corpora, written

Sample = tuple[list[str], list[list[str]]]
Clause = Mapping[str, Any]
Region = Mapping[str, Any]


def people() -> list[Sample]:
    """Return (tokens, right meanings) of all sentences that may be trained with."""
    found: list[Sample] = []
    for sentence in written.sentences(written.TRAINING):
        places = written.worlds()[sentence.map].places
        pairs = lifted_pairs(sentence.text, places, [one.clauses for one in sentence.truths])
        found += [pair for pair in pairs if not is_misnamed(*pair)] * 2
    return found + corpus_pairs()


def is_misnamed(tokens: Sequence[str], meanings: Sequence[Sequence[str]]) -> bool:
    """Whether a group is in the sentence, and its meaning names a place that is not.

    Mostly the group that the words stand for and the one that is meant differ by a place.
    """
    has_group = any(token[:2] in ('@G', '@Y') for token in tokens)
    return has_group and any(UNKNOWN in meaning for meaning in meanings)


def misread() -> dict[tuple[str, ...], list[list[str]]]:
    """Return wrong meanings that earlier readers, who had not seen them, took sentences for."""
    file = Path(written.__file__).with_name('misread.json')
    found = {}
    for entry in json.loads(file.read_text(encoding='utf-8')):
        one = lifted(entry['text'], written.worlds()[entry['map']].places)
        meanings = [meaning.split() for meaning in entry['meanings']]
        found[one.tokens] = [
            m for m in meanings if {t for t in m if t[1:].isdigit()} <= {*one.slots}
        ]
    return found


def lifted_pairs(text: str, places: Places, truths: Sequence[Sequence[Clause]]) -> list[Sample]:
    """Return a sentence with its meanings in a list, empty where slots cannot say them.

    Without truths nothing can be read for certain.
    """
    one = lifted(text, places)
    meanings: list[list[str]] = [] if truths else [[]]
    for clauses in truths:
        told = [{'about': about(c['text']), **c} if 'text' in c else c for c in clauses]
        try:
            meanings.append(Translation(one.slots, places).meaning(told))
        except Unreadable:
            continue
    return [(list(one.tokens), meanings)] if meanings else []


def about(text: str) -> str:
    """Return what words that a path does not have are about, by their first letters."""
    words = text.lower()
    for name, parts in ABOUT.items():
        if any(part in words for part in parts):
            return name
    return 'action'


ABOUT = {
    'speed': ('slow', 'fast', 'quick', 'speed', 'langsam', 'schnell', 'lent', 'vite', 'despacio',
              'rápido', 'hurry', 'pace', 'rush', 'tempo', 'douc', 'race', 'beeil', 'prisa'),
    'waiting': ('wait', 'warte', 'attend', 'esper', 'pause', 'stop for', 'minute', 'hold',
                'linger', 'second', 'sekunde'),
    'time': ('before', 'after', 'o\'clock', 'noon', 'uhr', 'heure', 'hora', 'by ', 'am', 'pm',
             'tonight', 'morning', 'lunch', 'midi', 'until'),
    'following': ('follow', 'behind', 'folg', 'suis', 'sigue', 'escort', 'accompan', 'begleit'),
    'manner': ('quiet', 'leise', 'silen', 'bruit', 'ruido', 'careful', 'vorsicht', 'gent', 'light',
               'smile', 'noise', 'nice', 'polite', 'hupen', 'horn', 'beep', 'wak', 'horn'),
}  # fmt: skip


def corpus_pairs() -> list[Sample]:
    """Return the pairs of the public corpora, of the patterns that clauses can say."""
    if corpora.folder() is None:
        return []
    found: list[Sample] = []
    for world, sentences in (
        (corpora.rooms_world(), corpora.lang2ltl()),
        (corpora.cleanup_world(), corpora.cleanup()),
        (corpora.house_world(), corpora.houseworld()),
    ):
        for name, text, truths in sentences:
            found += corpus_pair(name, text, truths[0], world.places)
    return found


def corpus_pair(name: str, text: str, truth: Any, places: Places) -> list[Sample]:
    """Return the pair of a sentence with a formula in a list; none where clauses cannot say it."""
    if not truth.says:
        one = lifted(text, places)
        return [(list(one.tokens), [[]])]
    if 'restricted' in name:
        one = lifted(text, places)
        counts = [
            (name, slot.value[2])
            for name, slot in one.slots.items()
            if name[0] == 'K' and isinstance(slot.value, tuple)
        ]
        regions = [n for n in one.slots if n[0] == 'R']
        if len(counts) != 1 or len(regions) != 1:
            return []
        return [(list(one.tokens), [['CN' if counts[0][1] else 'C', regions[0], counts[0][0]]])]
    try:
        return lifted_pairs(text, places, [list(clauses_of(truth.formula, truth.regions))])
    except Unreadable:
        return []


def clauses_of(formula: Any, regions: Mapping[str, Region]) -> list[Clause]:
    """Return clauses in JSON of a formula. Raises Unreadable."""

    def region(part: Any) -> Region:
        if isinstance(part, tuple) and part[0] == '|':
            return {'any_of': [region(one) for one in part[1:]]}
        if not isinstance(part, str):
            raise Unreadable
        return regions[part]

    found: list[Clause] = []
    free: list[Region] = []
    for part in corpora.conjuncts(formula):
        head = part[0] if isinstance(part, tuple) else ''
        if head == 'F':
            inner = part[1]
            if isinstance(inner, tuple) and inner[0] == '&':
                found += [{'kind': 'visit', 'regions': [one]} for one in chain(part, region)]
            else:
                free.append(region(inner))
        elif head == 'G' and part[1][0] == '!':
            found.append({'kind': 'avoid', 'region': region(part[1][1])})
        elif head == 'W' and part[1][0] == '!' and isinstance(part[2], str):
            found.append(
                {'kind': 'before', 'first': region(part[2]), 'second': region(part[1][1])}
            )
        elif head == 'G' and part[1][0] in ('i', '>'):
            found.append(reaction(part[1], region))
        else:
            raise Unreadable
    if free:
        befores = [one for one in found if one['kind'] == 'before']
        found = merged(free, found, befores)
    return found


def merged(free: list[Region], found: list[Clause], befores: list[Clause]) -> list[Clause]:
    """Return clauses with free visits: after those before which another region must come."""
    if len(befores) == 1 and len(free) == 1 and befores[0]['second'] == free[0]:
        visits = [{'kind': 'visit', 'regions': [befores[0]['first']]}]
        return [*visits, {'kind': 'visit', 'regions': free}, *found]
    if any(one['kind'] == 'visit' for one in found) or befores:
        raise Unreadable
    return [*found, {'kind': 'visit', 'regions': free}]


def chain(part: Any, region: Callable[[Any], Region]) -> list[Region]:
    """Return the regions of 'F & a F & b F c'. Raises Unreadable."""
    inner = part[1]
    if part[0] != 'F':
        raise Unreadable
    if isinstance(inner, tuple) and inner[0] == '&':
        return [region(inner[1]), *chain(inner[2], region)]
    return [region(inner)]


def reaction(part: Any, region: Callable[[Any], Region]) -> Clause:
    """Return the clause of 'a implies F b' or 'a implies X G ! b'. Raises Unreadable."""
    first, later = region(part[1]), part[2]
    if later[0] == 'F':
        return {'kind': 'then', 'first': first, 'second': region(later[1])}
    if later[0] in ('X', 'N') and later[1][0] == 'G' and later[1][1][0] == '!':
        return {'kind': 'never_after', 'first': first, 'second': region(later[1][1][1])}
    raise Unreadable


def known_words() -> set[str]:
    """Return the words that the network has seen often enough: no place may be among them.

    So not those of what a path does not have, among which are places that a map does not have, nor
    those of names on any map.
    """
    maps: dict[str, set[str]] = {}
    names: set[str] = set()
    for sentence in written.sentences(written.TRAINING):
        clauses = [clause for truth in sentence.truths for clause in truth.clauses]
        asked = {word for one in clauses for word in phrase_words(one.get('text', ''))}
        for token in lifted(sentence.text, written.worlds()[sentence.map].places).tokens:
            if token not in asked:
                maps.setdefault(token, set()).add(sentence.map)
    for name in {sentence.map for sentence in written.sentences(written.TRAINING)}:
        for place in written.worlds()[name].places:
            for said in (place.name, place.kind or '', *place.aliases):
                names |= {*phrase_words(said)}
    return {
        word
        for word, seen in maps.items()
        if len(seen) >= MAPS and word.isalpha() and word not in names
        if not nouns().everywhere.exactly([word])
    }


# On so many maps a word has been said that is no name of a place.
MAPS = 3
