# Copyright 2026 The LLM-A* for ROS 2 contributors
# SPDX-License-Identifier: Apache-2.0

"""From clauses to the meaning of a sentence: the way back of `meaning.Writer`.

So a reading that somebody else proposes, the grammar, a model or a person, can be checked by
the networks, and sentences with their clauses can be trained with.
"""

from collections.abc import Mapping, Sequence
from typing import Any

from llm_astar_msgs_adapter.maps.places import Places

from llm_astar_planner.instructions.clauses.unsupported import ABOUT
from llm_astar_planner.instructions.grammar.meaning import CLEAR
from llm_astar_planner.instructions.grammar.selection import OPPOSITE
from llm_astar_planner.instructions.reader import meaning
from llm_astar_planner.instructions.reader.lifting import Slot
from llm_astar_planner.instructions.regions import Region

Json = Mapping[str, Any]
LETTERS = {
    kind: letter for letter, (kind, *_) in meaning.FIELDS.items() if letter not in ('PX', 'K')
}


class Translation:
    """Writes clauses in JSON as tokens, with the slots of a sentence."""

    def __init__(self, slots: Mapping[str, Slot], places: Places) -> None:
        """Take the slots by name."""
        self.slots, self.places = slots, places

    def meaning(self, clauses: Sequence[Json]) -> list[str]:
        """Return the tokens of clauses, each but visits once. Raises Unreadable if slots lack."""
        found = [
            (*([meaning.WISH] if clause.get('strength') == 'should' else []), *tokens)
            for clause in clauses
            for tokens in self.clause(clause)
        ]
        kept = [one for n, one in enumerate(found) if 'V' in one or one not in found[:n]]
        return [token for tokens in kept for token in tokens] or [meaning.NOTHING]

    def clause(self, clause: Json) -> list[list[str]]:
        """Return the tokens of one clause, or of two that mean the same. Raises Unreadable."""
        match kind := clause['kind']:
            case 'count':
                region = self.region(clause['region'])
                return self.count(clause.get('at_least') or 0, clause.get('at_most'), region)
            case 'unsupported':
                found = [f'U_{clause.get("about", ABOUT[-1])}']
            case 'visit':
                found = ['V', *self.visited(clause['regions']), meaning.CLOSE]
            case 'keep_distance':
                walls = clause['from'] == 'walls'
                region = ['WALLS'] if walls else self.region(clause['from'])
                usual = 'D' if clause['metres'] == CLEAR else ''
                found = ['K', *region, self.slot('L', clause['metres'], usual)]
            case 'pass':
                found = self.passed(self.region(clause['region']), clause['side'])
            case _ if kind in LETTERS:
                named = [clause[n] for n in ('region', 'first', 'second') if n in clause]
                found = [LETTERS[kind], *self.regions(named)]
            case _:
                raise meaning.Unreadable(f'no word for {kind}')
        return [found]

    def passed(self, region: list[str], side: str) -> list[str]:
        """Return the tokens of a side to pass; 'keep it on your left' says the other one."""
        name = self.slot('S', side, '?')
        if name != '?':
            return ['P', *region, name]
        return ['PX', *region, self.slot('S', OPPOSITE[side])]

    def count(self, least: int, most: int | None, region: list[str]) -> list[list[str]]:
        """Return the tokens of a number of entries. Raises Unreadable."""
        for name, slot in self.slots.items():
            if isinstance(slot.value, tuple) and slot.entries == (least, most):
                return [['CN' if slot.value[2] else 'C', *region, name]]
        if least and most is not None and least != most:
            return [*self.count(least, None, region), *self.count(0, most, region)]
        head = 'CE' if least == most else 'CG' if least else 'CL'
        number = least or most or 0
        return [[head, *region, self.slot('K', number, meaning.ONE if number == 1 else '')]]

    def slot(self, kind: str, value: object, otherwise: str = '') -> str:
        """Return the name of a slot with a value. Raises Unreadable for none."""
        found = (n for n, slot in self.slots.items() if n[0] == kind and slot.means(value))
        name = next(found, otherwise)
        if not name:
            raise meaning.Unreadable(f'{value} is not in the sentence')
        return name

    def visited(self, regions: Sequence[Json]) -> list[str]:
        """Return the tokens of regions to visit, a group once."""
        found: list[str] = []
        left = list(regions)
        named = [slot.in_json for name, slot in self.slots.items() if name[0] == 'R']
        for name, slot in self.slots.items():
            members = [one.to_json() for one in slot.members]
            # Of those that have all slots of their own no group is meant.
            is_group = members and not all(one in named for one in members)
            if is_group and all(one in left for one in members):
                found += ['EA', name]
                left = [one for one in left if one not in members]
        return [*self.regions(left), *found]

    def region(self, region: Json) -> list[str]:
        """Return the tokens of a region; '?' for a place that the sentence does not name."""
        found = [self.named(region)]
        match region:
            case _ if found[0]:
                pass
            case {'any_of': parts}:
                found = ['OR', *self.regions(parts), meaning.CLOSE]
            case {'region': inner, 'except': others}:
                found = ['EX', *self.regions([inner, *others]), meaning.CLOSE]
            case {'half': side, 'of': str(name)}:
                found = ['HO', self.slot('S', side), *self.region({'place': name})]
            case {'half': side}:
                found = ['HF', self.slot('S', side)]
            case {'along': name}:
                found = ['AL', *self.region({'place': name})]
            case {'between': names}:
                found = ['BW', *self.regions([{'place': name} for name in names])]
            case {'end': end}:
                found = [end.upper()]
            case {'place': _} | {'tag': _}:
                found = [meaning.UNKNOWN]
            case _:
                raise meaning.Unreadable('no such region in the sentence')
        return found

    def regions(self, regions: Sequence[Json]) -> list[str]:
        """Return the tokens of several regions."""
        return [token for one in regions for token in self.region(one)]

    def named(self, region: Json) -> str:
        """Return the slot of a region, of the same places by another word too; '' for none."""
        wanted = self.names_in(region)
        for name, slot in self.slots.items():
            if isinstance(slot.value, Region):
                mine = slot.value.to_json()
                if mine == region or (wanted and self.names_in(mine) == wanted):
                    return name
        return ''

    def names_in(self, region: Json) -> set[str]:
        """Return the names of the places that a region joins; none of other regions."""
        match region:
            case {'place': name}:
                place = self.places.get(name)
                return {place.name} if place else set()
            case {'tag': tag}:
                return {place.name for place in self.places.with_tag(tag)}
            case {'any_of': parts} if all('place' in one or 'tag' in one for one in parts):
                return set().union(*map(self.names_in, parts))
        return set()
