"""Free sentences for the training: those written for this, and halves of public corpora.

The written ones are `test/language/written.json`; by a hash of a map's name half of the maps are
for training, the others are locked: they calibrate and report. The corpora are read from the
folder of LLM_ASTAR_INSTRUCTIONS where it is set.
"""

from __future__ import annotations

import sys
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any

from llm_astar_msgs_adapter.maps.places import Places
from llm_astar_planner.instructions.reader.lifting import Slot, lifted
from llm_astar_planner.instructions.regions import NamedPlace, Tagged

sys.path.insert(0, str(Path(__file__).resolve().parents[2] / 'test'))
from language import corpora, written

Pair = tuple[list[str], list[str]]
Clause = Mapping[str, Any]
Region = Mapping[str, Any]


class Unsayable(Exception):  # noqa: N818
    """A meaning that slots of the sentence cannot say."""


def people() -> list[Pair]:
    """Return (tokens, meaning) of all sentences that may be trained with, some several times."""
    found: list[Pair] = []
    for sentence in written.sentences(written.TRAINING):
        places = written.worlds()[sentence.map].places
        clauses = sentence.truths[0].clauses if sentence.truths else ()
        found += paired(sentence.text, places, clauses) * 2
    return found + corpus_pairs()


def paired(text: str, places: Places, clauses: Sequence[Clause]) -> list[Pair]:
    """Return the pair of a sentence in a list, which is empty where slots cannot say it."""
    one = lifted(text, places)
    try:
        return [(list(one.tokens), Writer(one.slots).meaning(clauses))]
    except Unsayable:
        return []


class Writer:
    """Writes clauses in JSON as tokens, with the slots of a sentence."""

    def __init__(self, slots: Mapping[str, Slot]) -> None:
        """Take the slots by name."""
        self.slots = slots

    def meaning(self, clauses: Sequence[Clause]) -> list[str]:
        """Return the tokens of clauses, each once. Raises Unsayable."""
        found: list[list[str]] = []
        for clause in clauses:
            wish = ['W'] if clause.get('strength') == 'should' else []
            tokens = wish + self.clause(clause)
            if tokens not in found:
                found.append(tokens)
        return [token for tokens in found for token in tokens]

    def clause(self, clause: Clause) -> list[str]:
        """Return the tokens of one clause. Raises Unsayable."""
        kind = clause['kind']
        if kind == 'unsupported':
            return [f'U_{clause.get("about", about(clause["text"]))}']
        if kind == 'visit':
            return ['V', *self.visited(clause['regions']), ')']
        if kind in ('before', 'then', 'never_after'):
            letter = {'before': 'B', 'then': 'T', 'never_after': 'N'}[kind]
            return [letter, *self.region(clause['first']), *self.region(clause['second'])]
        if kind == 'keep_distance':
            walls = clause['from'] == 'walls'
            region = ['WALLS'] if walls else self.region(clause['from'])
            named = self.slot('L', clause['metres'])
            return ['K', *region, named or self.usual(clause['metres'])]
        region = self.region(clause['region'])
        if kind == 'count':
            return self.count(clause, region)
        if kind == 'pass':
            side = self.slot('S', clause['side'])
            if not side:
                raise Unsayable
            return ['P', *region, side]
        return [{'avoid': 'A', 'stay_in': 'S', 'end_at': 'E'}[kind], *region]

    def count(self, clause: Clause, region: list[str]) -> list[str]:
        """Return the tokens of a number of entries. Raises Unsayable."""
        wanted = (clause.get('at_least') or 0, clause.get('at_most'))
        for name, slot in self.slots.items():
            if name[0] == 'K':
                least, most, turns = slot.value
                if turns:
                    least, most = (0, least - 1) if least else (int(most) + 1, None)
                if (least, most) == wanted:
                    return ['CN' if turns else 'C', *region, name]
        raise Unsayable

    def usual(self, metres: float) -> str:
        """Return the token of the usual distance. Raises Unsayable for any other."""
        if metres != 1:
            raise Unsayable
        return 'D'

    def slot(self, kind: str, value: object) -> str:
        """Return the name of a slot with a value, '' for none."""
        return next(
            (n for n, slot in self.slots.items() if n[0] == kind and slot.value == value), ''
        )

    def visited(self, regions: Sequence[Region]) -> list[str]:
        """Return the tokens of regions to visit, a group once."""
        found: list[str] = []
        left = list(regions)
        for name, slot in self.slots.items():
            members = [one.to_json() for one in slot.members]
            if members and all(one in left for one in members) and not self.are_named(members):
                found += ['EA', name]
                left = [one for one in left if one not in members]
        return [*[t for one in left for t in self.region(one)], *found]

    def are_named(self, regions: Sequence[Region]) -> bool:
        """Whether all of some regions have slots of their own."""
        known = [slot.value.to_json() for name, slot in self.slots.items() if name[0] == 'R']
        return all(one in known for one in regions)

    def region(self, region: Region) -> list[str]:
        """Return the tokens of a region; '?' for a place that the sentence does not name."""
        if 'any_of' in region:
            return ['OR', *(t for one in region['any_of'] for t in self.region(one)), ')']
        if 'except' in region:
            parts = [region['region'], *region['except']]
            return ['EX', *(t for one in parts for t in self.region(one)), ')']
        if 'half' in region:
            side = self.slot('S', region['half'])
            if not side:
                raise Unsayable
            return (
                ['HO', side, *self.region({'place': region['of']})]
                if region.get('of')
                else ['HF', side]
            )
        if 'along' in region:
            return ['AL', *self.region({'place': region['along']})]
        if 'between' in region:
            return ['BW', *(t for one in region['between'] for t in self.region({'place': one}))]
        if 'end' in region:
            return [region['end'].upper()]
        return [self.place(region)]

    def place(self, region: Region) -> str:
        """Return the slot of a place or tag: of its own, or of a group that it is one of."""
        wanted = NamedPlace(region['place']) if 'place' in region else Tagged(region['tag'])
        exact = [n for n, slot in self.slots.items() if n[0] == 'R' and slot.value == wanted]
        among = [n for n, slot in self.slots.items() if wanted in slot.members]
        return (exact or among or ['?'])[0]


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


def corpus_pairs() -> list[Pair]:
    """Return the pairs of the public corpora, of the patterns that clauses can say."""
    if corpora.folder() is None:
        return []
    found: list[Pair] = []
    for world, sentences in (
        (corpora.rooms_world(), corpora.lang2ltl()),
        (corpora.cleanup_world(), corpora.cleanup()),
        (corpora.house_world(), corpora.houseworld()),
    ):
        for name, text, truths in sentences:
            found += corpus_pair(name, text, truths[0], world.places)
    return found


def corpus_pair(name: str, text: str, truth: Any, places: Places) -> list[Pair]:
    """Return the pair of a sentence with a formula in a list; none where clauses cannot say it."""
    if not truth.says:
        one = lifted(text, places)
        return [(list(one.tokens), [])]
    if 'restricted' in name:
        one = lifted(text, places)
        counts = [(n, s.value[2]) for n, s in one.slots.items() if n[0] == 'K']
        regions = [n for n in one.slots if n[0] == 'R']
        if len(counts) != 1 or len(regions) != 1:
            return []
        return [(list(one.tokens), ['CN' if counts[0][1] else 'C', regions[0], counts[0][0]])]
    try:
        return paired(text, places, list(clauses_of(truth.formula, truth.regions)))
    except Unsayable:
        return []


def clauses_of(formula: Any, regions: Mapping[str, Region]) -> list[Clause]:
    """Return clauses in JSON of a formula. Raises Unsayable."""

    def region(part: Any) -> Region:
        if isinstance(part, tuple) and part[0] == '|':
            return {'any_of': [region(one) for one in part[1:]]}
        if not isinstance(part, str):
            raise Unsayable
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
            raise Unsayable
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
        raise Unsayable
    return [*found, {'kind': 'visit', 'regions': free}]


def chain(part: Any, region: Callable[[Any], Region]) -> list[Region]:
    """Return the regions of 'F & a F & b F c'. Raises Unsayable."""
    inner = part[1]
    if part[0] != 'F':
        raise Unsayable
    if isinstance(inner, tuple) and inner[0] == '&':
        return [region(inner[1]), *chain(inner[2], region)]
    return [region(inner)]


def reaction(part: Any, region: Callable[[Any], Region]) -> Clause:
    """Return the clause of 'a implies F b' or 'a implies X G ! b'. Raises Unsayable."""
    first, later = region(part[1]), part[2]
    if later[0] == 'F':
        return {'kind': 'then', 'first': first, 'second': region(later[1])}
    if later[0] in ('X', 'N') and later[1][0] == 'G' and later[1][1][0] == '!':
        return {'kind': 'never_after', 'first': first, 'second': region(later[1][1][1])}
    raise Unsayable


def known_words() -> set[str]:
    """Return the words that the network has seen often enough: no place may be among them."""
    maps: dict[str, set[str]] = {}
    for sentence in written.sentences(written.TRAINING):
        for token in lifted(sentence.text, written.worlds()[sentence.map].places).tokens:
            maps.setdefault(token, set()).add(sentence.map)
    return {word for word, seen in maps.items() if len(seen) >= MAPS and word.isalpha()}


# On so many maps a word has been said that is no name of a place.
MAPS = 3
