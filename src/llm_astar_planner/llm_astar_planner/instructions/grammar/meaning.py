# Copyright 2026 The LLM-A* for ROS 2 contributors
# SPDX-License-Identifier: Apache-2.0

"""What one clause means: lark's LALR(1) parser, linear in the lexemes, and its callbacks."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from functools import cache
from itertools import product
from pathlib import Path
from typing import Any

from lark import Lark, Token, Transformer, v_args
from lark.exceptions import UnexpectedInput, VisitError
from lark.lexer import Lexer as LarkLexer

from llm_astar_planner.instructions import regions
from llm_astar_planner.instructions.clauses.avoid import Avoid
from llm_astar_planner.instructions.clauses.before import Before
from llm_astar_planner.instructions.clauses.clause import SHOULD, Clause, Clauses
from llm_astar_planner.instructions.clauses.count import MAX_ENTRIES, Count
from llm_astar_planner.instructions.clauses.end_at import EndAt
from llm_astar_planner.instructions.clauses.keep_distance import KeepDistance
from llm_astar_planner.instructions.clauses.never_after import NeverAfter
from llm_astar_planner.instructions.clauses.pass_by import Pass
from llm_astar_planner.instructions.clauses.stay_in import StayIn
from llm_astar_planner.instructions.clauses.then import Then
from llm_astar_planner.instructions.clauses.visit import Visit
from llm_astar_planner.instructions.fields import MAX_METRES, SpecificationError
from llm_astar_planner.instructions.grammar import selection
from llm_astar_planner.instructions.grammar.lexemes import Lexeme
from llm_astar_planner.instructions.grammar.lexicon import PASSAGE, Group, generic_of
from llm_astar_planner.instructions.grammar.selection import Selection, Unclear, unclear_if
from llm_astar_planner.instructions.grammar.vocabulary import KINDS
from llm_astar_planner.instructions.regions import Region

# Typed differently by the versions of lark: 1.x, and lark-parser 0.12 of the ROS wheels.
Callbacks: Any = Transformer
Lexer: Any = LarkLexer
GRAMMAR = Path(__file__).with_name('clauses.lark')
DOOR = 'door'
# Metres. What keeps away from a place, or avoids what nobody can enter, without a number.
CLEAR = 1.0
AWAY = 'away'
# Sides of what lies so on the map, of a line of y or of a place, and of one of x.
DIRECTIONS = {'ABOVE': ('north', 'east'), 'BELOW': ('south', 'west')}
Things = tuple[Selection, ...]
Modifiers = list[selection.Modifier]
Described = tuple[Group, Modifiers]


@dataclass(frozen=True)
class ParsedClause:
    """What one clause of an instruction says.

    `things` are regions without a verb; `is_negative` where a 'not' stands before them. `question`
    names what is asked of the person, '' where all is certain.
    """

    clauses: Clauses = ()
    things: Things = ()
    is_negative: bool = False
    question: str = ''


# What a rule of a clause means: one clause or more, or a ParsedClause.
Meant = Clause | Clauses | ParsedClause


def visit_of(things: Things) -> Visit:
    """Return the visit of all things, in any order. Raises Unclear."""
    found: list[Region] = []
    for thing in things:
        unclear_if(thing.is_walls, 'walls cannot be visited')
        found += [thing.one] if thing.any_one else thing.regions
    return Visit(regions=tuple(found))


def avoid_of(things: Things, metres: float = 0.0) -> Clauses:
    """Return what avoids all things. Raises Unclear."""
    clauses: list[Clause] = []
    for thing in things:
        unclear_if(thing.any_one == 'one', 'which one is to be avoided')
        if thing.is_walls or (all_objects(thing) and not metres):
            clauses += distance_of((thing,), metres or CLEAR)
        elif thing.is_point and metres:
            clauses.append(Avoid(region=with_radius(thing, metres)))
        else:
            clauses += [Avoid(region=region, margin=metres) for region in thing.each]
    return tuple(clauses)


def distance_of(things: Things, metres: float) -> Clauses:
    """Return what keeps a distance from all things. Raises Unclear."""
    clauses: list[Clause] = []
    for thing in things:
        unclear_if(thing.any_one == 'one', 'a distance from which one')
        if thing.is_point:
            clauses.append(Avoid(region=with_radius(thing, positive(metres))))
        else:
            apart = (None,) if thing.is_walls else thing.each
            clauses += [KeepDistance(metres=positive(metres), region=one) for one in apart]
    return tuple(clauses)


def befores(firsts: Things, seconds: Things) -> Clauses:
    """Return that each of the second things is entered after each of the first ones."""
    unclear_if(any(two.is_all for two in seconds), 'some of them or none')
    return tuple(
        Before(first=first, second=two.one) for two in seconds for first in each_of(firsts)
    )


def each_of(things: Things) -> list[Region]:
    """Return the regions of things, each of a group, one where any of them will do."""
    return [
        region
        for one in things
        for region in ((one.one,) if one.any_one or not one.is_group else one.regions)
    ]


def after_each(kind: type[Then | NeverAfter], firsts: Things, seconds: Things) -> Clauses:
    """Return what holds of each of the second things after each entry of one of the first."""
    if any(thing.is_walls or thing.is_all for thing in (*firsts, *seconds)):
        raise Unclear('some of them or none')
    pairs = list(product(each_of(firsts), each_of(seconds)))
    unclear_if(kind is Then and len(firsts) > 1, 'after both of them or after each')
    return tuple(kind(first=first, second=second) for first, second in pairs)


def with_radius(thing: Selection, metres: float) -> regions.Disc:
    """Return a point as a disc."""
    point = thing.one
    if not isinstance(point, regions.Disc):
        raise Unclear('no point')
    return regions.Disc(point.x, point.y, metres)


def positive(metres: float) -> float:
    """Return a distance. Raises Unclear where there is none."""
    unclear_if(not 0.0 < float(metres) <= MAX_METRES, 'no distance that can be kept')
    return float(metres)


def strip_along(thing: Selection, metres: float) -> regions.Along:
    """Return the strip around a place or the walls."""
    return regions.Along(regions.WALLS if thing.is_walls else thing.place.name, positive(metres))


def all_objects(thing: Selection) -> bool:
    """Whether a selection is of objects."""
    return bool(thing.places) and all(place.is_object for place in thing.places)


def refuse_half_of_object(thing: Selection) -> None:
    """Raise Unclear for 'the south side of the rack': nobody can drive in it."""
    if isinstance(thing.one, regions.Half) and all_objects(thing):
        raise Unclear('the side of what nobody can enter')


def joined(region: Region) -> Region:
    """Return a region put together of others. Raises Unclear where it is too deep or too large."""
    try:
        return regions.region_from_json(region.to_json(), '')
    except SpecificationError as error:
        raise Unclear(str(error)) from None


def without(thing: Selection, left_out: tuple[Region, ...]) -> Selection:
    """Return a selection without some regions. Raises Unclear where nothing is left of it."""
    is_one = len(thing.each) == 1 or bool(thing.any_one)
    rest = joined(regions.Except(thing.one, left_out)) if is_one else None
    kept = tuple(region for region in thing.regions if region not in left_out)
    unclear_if(rest is None and not kept, 'nothing is left')
    places = tuple(one for one in thing.places if regions.NamedPlace(one.name) not in left_out)
    if not thing.is_group or (rest is not None and thing.any_one):
        return replace(thing, regions=(rest,), together=None, places=())  # type: ignore[arg-type]
    return replace(thing, regions=kept, together=rest, places=places)


def count_of(things: Things, least: int, most: int | None) -> Clauses:
    """Return how often each thing is entered. Raises Unclear."""
    if max(least, most or 0) > MAX_ENTRIES or any(thing.is_walls for thing in things):
        raise Unclear('too often')
    return tuple(Count(region=one, at_least=least, at_most=most) for one in each_of(things))


def single(things: Things) -> Selection:
    """Return the only thing. Raises Unclear where there are several."""
    unclear_if(len(things) != 1, 'several things where one is expected')
    return things[0]


def value(token: Token) -> Any:
    """Return what a lexeme stands for."""
    return token.value.value


def tokens_of(parts: tuple[Any, ...]) -> list[Token]:
    """Return the lexemes among the parts of a clause."""
    return [part for part in parts if isinstance(part, Token)]


class Later(Things):
    """Things that come after the others of their clause, whichever were said first."""


def in_turn(parts: tuple[Any, ...]) -> list[Things]:
    """Return the things among the parts of a clause, those that come later last."""
    found = [part for part in parts if isinstance(part, tuple)]
    return sorted(found, key=lambda part: isinstance(part, Later))


def visits(*in_turn: Things) -> Clauses:
    """Return the visits of some things, one after the other."""
    refused = tuple(one for things in in_turn for thing in things for one in thing.refused)
    return (*(visit_of(things) for things in in_turn), *avoid_of(refused))


@v_args(inline=True)
class ClauseCallbacks(Callbacks):  # type: ignore[misc]
    """Called by the parser for each rule of `clauses.lark`, with what its parts mean.

    A clause of the sentence is one or more of the specification, or a ParsedClause that says more.
    """

    def start(self, meant: Meant) -> ParsedClause:
        """All of it."""
        if isinstance(meant, ParsedClause):
            return meant
        return ParsedClause(meant if isinstance(meant, tuple) else (meant,))

    # ---- avoid

    def avoid(self, *parts: Any) -> Meant:
        """'avoid A and B', 'skip A', 'leave A alone', but 'stay clear of A' keeps a distance."""
        *verb, things = parts
        return self.keep_away(things) if AWAY in map(value, verb) else avoid_of(things)

    def keep_away(self, things: Things) -> Meant:
        """'keep away from A', without a number; of 'all but A' it is to avoid them."""
        return distance_of(things, CLEAR)

    def avoid_use(self, *parts: Any) -> Meant:
        """'avoid visiting A'; what is no more than to come near it cannot be refused so."""
        how, things = parts[-2:]
        if how == 'STOPBY' or (
            how in ('VISIT', 'PASSBY', 'ALONG') and any(map(all_objects, things))
        ):
            raise Unclear('it may be passed')
        return avoid_of(things)

    def refuse(self, *parts: Any) -> Meant:
        """'do not enter A', but 'do not enter all of them' allows some."""
        *how, things = parts
        unclear_if(any(thing.is_all for thing in things), 'some of them or none')
        return self.avoid_use(how[0] if how else '', things)

    def closed(self, things: Things) -> Meant:
        """'A is closed'."""
        unclear_if(any(thing.any_one for thing in things), 'which one is closed')
        return avoid_of(things)

    def avoid_around(self, things: Things) -> Meant:
        """'go around A'; in 'go around the racks on the north side' the side is the way's.

        To go around the west end of a wall is to pass it in the west.
        """
        if any(isinstance(region, regions.Half) for thing in things for region in thing.regions):
            return self.pass_half(single(things))
        if any(thing.is_positioned for thing in things):
            raise Unclear('the side of the places or of the way')
        return avoid_of(things)

    def avoid_by(self, *parts: Any) -> Meant:
        """'avoid A by 3 m', 'keep away from A by 3 m'."""
        things, metres = parts[-2:]
        is_away = isinstance(parts[0], Token) and value(parts[0]) == AWAY
        return (distance_of if is_away else avoid_of)(things, metres)

    def avoid_field(self, thing: Selection) -> Meant:
        """'do not go north of y = 10'."""
        if not isinstance(thing.one, (regions.Box, regions.Half, regions.Between)):
            raise Unclear('no area')
        return avoid_of((thing,))

    def not_bare(self, things: Things) -> Meant:
        """'not A', which means something only after a visit."""
        unclear_if(len(things) > 1 or any(thing.is_all for thing in things), 'not what')
        return ParsedClause(avoid_of(things), is_negative=True)

    def by(self, metres: Token) -> float:
        """'by 3 m'."""
        return float(value(metres))

    # ---- distances

    def keep_distance(self, *parts: Any) -> Meant:
        """'keep 3 m away from A and B', 'do not approach A closer than 2 m'."""
        (metres,), (things,) = tokens_of(parts), in_turn(parts)
        return distance_of(things, float(value(metres)))

    # ---- visits

    def visit(self, *parts: Any) -> Meant:
        """'visit A and B'."""
        return visits(parts[-1])

    def visit_half(self, side: Token) -> Meant:
        """'by the east'."""
        return Visit(regions=(regions.Half(str(value(side))),))

    def go_near(self, things: Things) -> Meant:
        """'go near A', 'go past A'."""
        if any(thing.is_point or isinstance(thing.one, regions.End) for thing in things):
            raise Unclear('how near')
        strips = tuple(strip_along(thing, regions.NEAR_WIDTH) for thing in things)
        return ParsedClause((Visit(regions=strips),))

    def patrol(self, things: Things, rounds: Token | None = None) -> Meant:
        """'patrol A, B and C twice': the round, twice; without a number one, to be confirmed."""
        least, most, _ = (1, 1, False) if rounds is None else value(rounds)
        unclear_if(least != most, 'how many rounds')
        round_of = [Visit(regions=(region,)) for thing in things for region in each_of((thing,))]
        return ParsedClause(tuple(round_of * least), question='' if rounds else 'round')

    def come_back(self) -> Meant:
        """'there and back', 'come back'."""
        return Visit(regions=(regions.End('goal'),)), EndAt(region=regions.End('start'))

    def enter(self, *tokens: Token) -> str:
        """'go through', 'take'; says whether it is 'pass by' or 'along'."""
        return tokens[0].type if tokens else ''

    def later(self, things: Things) -> Things:
        """'A' of 'visit A after B'."""
        return Later(things)

    def visit_in_turn(self, *parts: Any) -> Meant:
        """'go through A to B', 'visit A before B', 'after A visit B'."""
        return visits(*in_turn(parts))

    def visit_after_you(self, *parts: Any) -> Meant:
        """'after you visit A, go to B': both, and B after each entry of A."""
        return (*visits(*in_turn(parts)), *after_each(Then, *in_turn(parts)))

    def only_after(self, how: str, *parts: Any) -> Meant:
        """'visit B only after A': both, and B not before; 'enter B only after A' asks for none."""
        firsts, seconds = in_turn(parts)
        orders = befores(firsts, seconds)
        return orders if how == 'ENTER' else (*visits(firsts, seconds), *orders)

    # ---- conditions and counts

    def then(self, *parts: Any) -> Meant:
        """'once you visit A, you must go to B'."""
        return after_each(Then, *in_turn(parts))

    def never_after(self, *parts: Any) -> Meant:
        """'after A never B', 'once in A do not enter B'."""
        return after_each(NeverAfter, *in_turn(parts))

    def count(self, *parts: Any) -> Meant:
        """'visit A at most twice'."""
        (times,), (things,) = tokens_of(parts), in_turn(parts)
        return count_of(things, *value(times)[:2])

    def count_not(self, *parts: Any) -> Meant:
        """'never go to A more than twice'."""
        (times,), (things,) = tokens_of(parts), in_turn(parts)
        least, most, turns = value(times)
        unclear_if(not turns, 'not so often')
        return count_of(things, 0, least - 1) if least else count_of(things, int(most) + 1, None)

    def before(self, *parts: Any) -> Meant:
        """'A must be visited before B'; of several, each of them."""
        return befores(*in_turn(parts))

    def visit_before(self, _: str, first: Things, how: str, second: Things) -> Meant:
        """'visit A before you enter B', which need not be; 'visit A before going to B'."""
        return befores(first, second) if how == 'ENTER' else visits(first, second)

    def before_visit(self, how: str, second: Things, _: str, first: Things) -> Meant:
        """'before you enter B, visit A'."""
        return self.visit_before('', first, how, second)

    def move_in(self, thing: Selection) -> Meant:
        """'drive in the north half'."""
        if not isinstance(thing.one, (regions.Half, regions.Box)):
            raise Unclear('through it or within it')
        return StayIn(SHOULD, region=thing.one)

    # ---- stay

    def stay_in(self, thing: Selection) -> Meant:
        """'stay in the corridor'."""
        refuse_half_of_object(thing)
        return StayIn(region=thing.one)

    def stay_on(self, thing: Selection) -> Meant:
        """'stay on the north side', 'stay on the bridge'; but where is 'stay at the desk'."""
        if isinstance(thing.one, (regions.Half, regions.Box)):
            return self.keep_to(thing)
        unclear_if(generic_of(thing.place) != PASSAGE, 'to stay in it or to end there')
        return self.stay_in(thing)

    def keep_to(self, thing: Selection) -> Meant:
        """'keep to the south side'."""
        refuse_half_of_object(thing)
        if isinstance(thing.one, regions.Box) and thing.one.outside:
            return self.stay_field(thing)
        return StayIn(SHOULD, region=thing.one)

    def keep_side(self, side: str) -> Meant:
        """'keep north', 'as far north as you can'."""
        return StayIn(SHOULD, region=regions.Half(side))

    def stay_field(self, thing: Selection) -> Meant:
        """'stay south of y = 10'."""
        region = thing.one
        if not isinstance(region, regions.Box):
            raise Unclear('to stay in what')
        return Avoid(region=region.outside) if region.outside else StayIn(region=region)

    def take(self, thing: Selection) -> Meant:
        """'take the middle aisle' is to drive along it, 'take the door' is to go through."""
        if isinstance(thing.one, (regions.Half, regions.Box)):
            return self.keep_to(thing)
        if isinstance(thing.one, regions.Between):
            return visits((thing,))
        generic = generic_of(thing.place)
        if generic == DOOR:
            return visits((thing,))
        unclear_if(generic != PASSAGE, 'to go through it or to stay in it')
        return self.keep_to(thing)

    def follow(self, *parts: Any) -> Meant:
        """'drive along the corridor', 'follow the wall'."""
        things: Things = parts[-1]
        thing = single(things)
        if thing.is_walls or (thing.places and thing.place.is_object):
            return self.stay_close(things)
        is_place = bool(thing.places) and not isinstance(thing.one, regions.Half)
        unclear_if(is_place and generic_of(thing.place) != PASSAGE, 'along it or through it')
        return self.keep_to(thing)

    def drive_on(self, thing: Selection) -> Meant:
        """'drive on the north side', 'drive on the north side of the rack'."""
        region = thing.one
        if not isinstance(region, regions.Half):
            raise Unclear('to drive on what')
        return self.pass_half(thing) if region.of else self.keep_to(thing)

    def stay_close(self, things: Things) -> Meant:
        """'hug the walls'."""
        strip = strip_along(single(things), regions.ALONG_WIDTH)
        return StayIn(SHOULD, region=strip)

    def stay_within(self, metres: Token, things: Things) -> Meant:
        """'stay within 2 m of the walls'."""
        thing = single(things)
        around = with_radius if thing.is_point else strip_along
        return StayIn(region=around(thing, positive(value(metres))))

    # ---- pass

    def pass_at(self, things: Things, side: str) -> Meant:
        """'pass A on the north side'."""
        thing = single(things)
        unclear_if(thing.is_positioned or thing.is_walls, 'the side of the places or of the way')
        return Pass(region=thing.one, side=side)

    def go_past(self, things: Things) -> Meant:
        """'drive past A' is to come near it, if it is an object or a point."""
        if len(things) == 1 and all_objects(things[0]) and isinstance(things[0].one, regions.Half):
            return self.pass_half(things[0])
        if all(
            isinstance(region, regions.Between) for thing in things for region in thing.regions
        ):
            return visits(things)
        unclear_if(any(thing.is_positioned for thing in things), 'past it or through it')
        if all(thing.is_point or all_objects(thing) for thing in things):
            return visits(things)
        return self.go_near(things)

    def pass_by_at(self, how: str, things: Things, *tokens: Token) -> Meant:
        """'pass by A on the north side'."""
        unclear_if(how != 'PASSBY', 'a side for what is visited')
        return self.pass_at(things, self.at_side(*tokens))

    def pass_of(self, side: Token, thing: Selection) -> Meant:
        """'pass north of A'."""
        return self.pass_at((thing,), str(DIRECTIONS.get(side.type, [value(side)])[0]))

    def pass_half(self, thing: Selection) -> Meant:
        """'pass on the north side of A'."""
        region = thing.one
        if not isinstance(region, regions.Half) or not region.of or not thing.place.is_object:
            raise Unclear('past it or through it')
        return Pass(region=regions.NamedPlace(region.of), side=region.side)

    def leave_at(self, thing: Selection, side: str) -> Meant:
        """'keep A on your left' is to pass it on its right."""
        return self.pass_at((thing,), selection.OPPOSITE[side])

    def at_side(self, *tokens: Token) -> str:
        """'on the north side'."""
        return next(str(value(token)) for token in tokens if token.type == 'SIDE')

    # ---- the rest

    def end_at(self, things: Things) -> Meant:
        """'end in A'."""
        thing = single(things)
        unclear_if(thing.is_group and not thing.any_one, 'in which of them')
        return EndAt(region=thing.one)

    def bare(self, things: Things) -> Meant:
        """Things without a verb."""
        return ParsedClause(things=things)

    # ---- regions

    def things(self, *things: Selection) -> Things:
        """'A, B and C'; 'x above 2 and x below 5' is one area."""
        limits = [thing for thing in things if thing.is_limit]
        if len(things) > 1 and any(thing.is_except for thing in things):
            raise Unclear('except from which of them')
        if len(limits) > 1:
            return (
                *(thing for thing in things if not thing.is_limit),
                *selection.joint_limits(limits),
            )
        return things

    def one_of(self, *things: Selection) -> Selection:
        """'A or B'."""
        parts = tuple(
            region
            for thing in things
            for region in ((thing.one,) if thing.any_one else thing.each)
        )
        unclear_if(len(set(parts)) < len(parts), 'the same place twice')
        return Selection((joined(regions.AnyOf(parts)),), any_one='one')

    def bracket(self, thing: Selection) -> Selection:
        """'(A except B)'."""
        return replace(thing, is_except=False)

    def area_of(self, thing: Selection) -> Selection:
        """'the area (A or B)'."""
        return replace(thing, any_one='')

    def overlap(self, things: Things) -> Selection:
        """'the overlap (A and B)'."""
        return Selection((joined(regions.AllOf(tuple(thing.one for thing in things))),))

    def except_of(self, thing: Selection, others: Things) -> Selection:
        """'all rooms except A and B'."""
        left_out = tuple(region for other in others for region in other.each)
        return replace(without(thing, left_out), is_except=True)

    def but_not(self, thing: Selection, others: Things) -> Selection:
        """'all rooms but not A': of what is to be visited A is refused, too."""
        return replace(self.except_of(thing, others), refused=others)

    def endpoint(self, token: Token) -> Selection:
        """'the start'."""
        return Selection((regions.End(value(token)),))

    def place(self, token: Token) -> Selection:
        """A name."""
        place = value(token)
        return Selection((regions.NamedPlace(place.name),), places=(place,))

    def all_of(self, _: Token, place: Selection) -> Selection:
        """'all of A'."""
        return replace(place, is_all=True)

    def point(self, token: Token) -> Selection:
        """'20, 12'."""
        x, y = value(token)
        return Selection((regions.Disc(x, y),), is_point=True)

    def group(self, described: Described, *where: Modifiers) -> Selection:
        """'the northern rooms', 'the room in the top left'."""
        noun, parts = described
        return selection.select_group(noun, parts, where[0] if where else [])

    def described(self, *parts: Any) -> Described:
        """'all blue rooms', 'la salle bleue': adjectives and the noun."""
        noun, *after = tokens_of(parts)
        adjectives = [part for part in parts if isinstance(part, selection.Modifier)]
        return value(noun), [*adjectives, *map(self.adjective, after)]

    def adjective(self, token: Token) -> selection.Modifier:
        """'blue', 'northern', 'all'."""
        return selection.Modifier(token.type, value(token))

    def where(self, *tokens: Token) -> Modifiers:
        """'in the top left', 'in the middle'."""
        return [selection.Modifier(token.type, value(token)) for token in tokens]

    def around(self, metres: Token, thing: Selection) -> Selection:
        """'the 3 m around 20, 12'."""
        unclear_if(not thing.is_point, 'a strip around a place is said as avoid it by')
        return Selection((with_radius(thing, positive(value(metres))),))

    def surroundings(self, thing: Selection) -> Selection:
        """'the surroundings of 20, 12', 'the area around it': a disc of the default radius."""
        return Selection(thing.regions)

    def half(self, *parts: Any) -> Selection:
        """'the north half of the lab'."""
        tokens = tokens_of(parts)
        whole = next((part.place for part in parts if isinstance(part, Selection)), None)
        return selection.half_of(self.at_side(*tokens), {one.type for one in tokens}, whole)

    def field(self, side: Token, line: Token) -> Selection:
        """'north of y = 10'."""
        axis, at = value(line)
        upright, across = DIRECTIONS.get(side.type, (value(side),) * 2)
        box = selection.axis_half(across if axis == 'x' else upright, axis, at)
        return Selection((box,), is_limit=True)

    def limits(self, box: Token) -> Selection:
        """'x below 10', 'between y = 5 and y = 20'."""
        return Selection((selection.common_box(value(box)),), is_limit=True)

    def ranges(self, *boxes: Token) -> Selection:
        """'the area with x from 1 to 2 and y above 3', 'the whole map'."""
        return Selection((selection.common_box(value(boxes[0]) if boxes else ()),))

    def between(self, *ends: Selection) -> Selection:
        """'between A and B', 'between the racks', if there are two."""
        names = [place.name for end in ends for place in end.places]
        unclear_if(len(names) != 2, 'between which two')
        return Selection((regions.Between(*names),))

    def rectangle(self, corner: Token, other: Token) -> Selection:
        """'the rectangle from 1, 2 to 3, 4'."""
        (x0, y0), (x1, y1) = value(corner), value(other)
        unclear_if(x0 == x1 or y0 == y1, 'an empty area')
        return Selection((regions.Box(min(x0, x1), min(y0, y1), max(x0, x1), max(y0, y1)),))

    def strip(self, metres: Token, _: Token, thing: Selection) -> Selection:
        """'the 1 m along the lab'."""
        return Selection((strip_along(thing, value(metres)),))


class LexemeLexer(Lexer):  # type: ignore[misc]
    """Hands the parser lexemes that were made before."""

    def __init__(self, _: object) -> None:
        """Take lark's configuration of a lexer, of which nothing is needed."""

    def lex(self, data: Sequence[Lexeme]) -> Iterator[Token]:
        """Yield a token for each lexeme; one of a kind that the grammar lacks ends the parse."""
        for lexeme in data:
            yield Token(lexeme.kind if lexeme.kind in KINDS.valued else f'_{lexeme.kind}', lexeme)


@cache
def clause_parser() -> Any:
    """Return the parser, built when the first clause is read."""
    grammar = GRAMMAR.read_text(encoding='utf-8')
    return Lark(grammar, parser='lalr', lexer=LexemeLexer, transformer=ClauseCallbacks())


def parse_clause(lexemes: Sequence[Lexeme]) -> ParsedClause:
    """Return what the lexemes of one clause say. Raises Unclear where it cannot be said."""
    try:
        reading: ParsedClause = clause_parser().parse(lexemes)
    except VisitError as error:
        if isinstance(error.orig_exc, Unclear):
            raise error.orig_exc from error
        raise
    except UnexpectedInput as error:
        raise Unclear('') from error
    return reading
