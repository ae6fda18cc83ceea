"""From the parts of a parsed clause to the clauses of a specification."""

from __future__ import annotations

from typing import Any

from lark import Token, v_args

from llm_astar_planner.instructions.grammar.asked import (
    Reading,
    Things,
    all_objects,
    avoid_of,
    befores,
    distance_of,
    positive,
    refuse_half_of_object,
    single,
    strip_along,
    visit_of,
    with_radius,
)
from llm_astar_planner.instructions.grammar.lexicon import (
    PASSAGE,
    generic_of,
    place_nouns,
)
from llm_astar_planner.instructions.grammar.region_meaning import RegionMeaning, side_in, value
from llm_astar_planner.instructions.grammar.regions import (
    Selection,
    Unclear,
    outside,
)
from llm_astar_planner.instructions.grammar.relative import OPPOSITE
from llm_astar_planner.instructions.specification import (
    ALONG_WIDTH,
    SHOULD,
    Avoid,
    Between,
    Box,
    EndAt,
    Half,
    NamedPlace,
    Pass,
    StayIn,
)

DOOR = 'door'
STOPBY = 'STOPBY'
# Verbs of which an object, which nobody enters, is as far as the robot comes near it.
NEARBY = frozenset({'VISIT', 'PASSBY', 'ALONG'})


def visits(*in_turn: Things) -> Reading:
    """Return the visits of some things, one after the other."""
    return Reading(tuple(visit_of(things) for things in in_turn))


@v_args(inline=True)
class Meaning(RegionMeaning):
    """Called by the parser for each rule of `clauses.lark`, with what its parts mean."""

    def start(self, reading: Reading) -> Reading:
        """The whole clause."""
        return reading

    # ---- avoid

    def avoid(self, *parts: Any) -> Reading:
        """'avoid A and B'; a verb of entering may stand before the things."""
        return Reading(avoid_of(parts[-1]))

    def avoid_use(self, how: str, things: Things) -> Reading:
        """'avoid visiting A'; what is no more than to come near it cannot be refused so."""
        if how == STOPBY or (how in NEARBY and any(map(all_objects, things))):
            raise Unclear('it may be passed')
        return Reading(avoid_of(things))

    def refuse(self, *parts: Any) -> Reading:
        """'do not enter A', but 'do not enter all of them' allows some."""
        *how, things = parts
        if any(thing.is_all for thing in things):
            raise Unclear('some of them or none')
        return self.avoid_use(how[0] if how else '', things)

    def closed(self, things: Things) -> Reading:
        """'A is closed'."""
        if any(thing.any_one for thing in things):
            raise Unclear('which one is closed')
        return Reading(avoid_of(things))

    def avoid_around(self, things: Things) -> Reading:
        """'go around A'; in 'go around the racks on the north side' the side is the way's."""
        if any(thing.is_positioned for thing in things):
            raise Unclear('the side of the places or of the way')
        return Reading(avoid_of(things))

    def avoid_by(self, things: Things, metres: float) -> Reading:
        """'avoid A by 3 m'."""
        return Reading(avoid_of(things, metres))

    def avoid_field(self, thing: Selection) -> Reading:
        """'do not go north of y = 10'."""
        if not isinstance(thing.one, (Box, Half, Between)):
            raise Unclear('no area')
        return Reading(avoid_of((thing,)))

    def not_bare(self, things: Things) -> Reading:
        """'not A', which means something only after a visit."""
        if len(things) > 1 or any(thing.is_all for thing in things):
            raise Unclear('not what')
        return Reading(avoid_of(things), is_negative=True)

    def by(self, metres: Token) -> float:
        """'by 3 m'."""
        return float(value(metres))

    # ---- distances

    def keep_distance(self, *parts: Any) -> Reading:
        """'keep 3 m away from A and B'; a distance and the things among the parts."""
        token, things = (part for part in parts if part is not None)
        return Reading(distance_of(things, float(value(token))))

    def keep_distance_after(self, things: Things, metres: Token) -> Reading:
        """'do not approach A closer than 2 m'."""
        return Reading(distance_of(things, float(value(metres))))

    def away(self) -> None:
        """'from', 'to'."""

    # ---- visits

    def visit(self, *parts: Any) -> Reading:
        """'visit A and B'."""
        return visits(parts[-1])

    def visit_between(self, gap: Selection) -> Reading:
        """'drive between A and B'."""
        return visits((gap,))

    def missing(self, *_: Any) -> None:
        """'miss', 'forget to visit'."""

    def enter(self, *tokens: Token) -> str:
        """'go through'; says whether it is 'pass by'."""
        return tokens[0].type if tokens else ''

    def use(self, *tokens: Token) -> str:
        """'take', 'drive along'; says whether it is 'along'."""
        return tokens[0].type if tokens else ''

    def visit_by_way_of(self, *parts: Any) -> Reading:
        """'go to B via A', 'before B visit A', 'visit B after A'."""
        second, first = (part for part in parts if isinstance(part, tuple))
        return visits(first, second)

    def visit_in_turn(self, *parts: Any) -> Reading:
        """'go through A to B', 'visit A before B', 'after A visit B'."""
        first, second = (part for part in parts if isinstance(part, tuple))
        return visits(first, second)

    def before(self, *parts: Any) -> Reading:
        """'A must be visited before B'; of several, each of them."""
        firsts, seconds = (part for part in parts if isinstance(part, tuple))
        return Reading(befores(firsts, seconds))

    def visit_before(self, _: str, first: Things, how: str, second: Things) -> Reading:
        """'visit A before you enter B', which need not be; 'visit A before going to B'."""
        if how == 'ENTER':
            return self.before(first, second)
        return visits(first, second)

    def before_visit(self, how: str, second: Things, _: str, first: Things) -> Reading:
        """'before you enter B, visit A'."""
        return self.visit_before('', first, how, second)

    def before_swapped(self, *parts: Any) -> Reading:
        """'do not enter B before A'."""
        seconds, firsts = (part for part in parts if isinstance(part, tuple))
        return Reading(befores(firsts, seconds))

    def until(self) -> None:
        """'before', 'until'."""

    def move_in(self, thing: Selection) -> Reading:
        """'drive in the north half'."""
        if not isinstance(thing.one, (Half, Box)):
            raise Unclear('through it or within it')
        return Reading((StayIn(SHOULD, region=thing.one),))

    # ---- stay

    def stay_in(self, thing: Selection) -> Reading:
        """'stay in the corridor'."""
        refuse_half_of_object(thing)
        return Reading((StayIn(region=thing.one),))

    def stay_on(self, thing: Selection) -> Reading:
        """'stay on the north side', 'stay on the bridge'; but where is 'stay at the desk'."""
        if isinstance(thing.one, (Half, Box)):
            return self.keep_to(thing)
        if generic_of(thing.place, place_nouns(thing.place)) != PASSAGE:
            raise Unclear('to stay in it or to end there')
        return self.stay_in(thing)

    def keep_to(self, thing: Selection) -> Reading:
        """'keep to the south side'."""
        refuse_half_of_object(thing)
        if isinstance(thing.one, Box) and outside(thing.one) is not None:
            return self.stay_field(thing)
        return Reading((StayIn(SHOULD, region=thing.one),))

    def keep_side(self, side: str) -> Reading:
        """'keep north', 'as far north as you can'."""
        return Reading((StayIn(SHOULD, region=Half(side)),))

    def toward_side(self, side: Token) -> str:
        """'to the north'."""
        return str(value(side))

    def stay_field(self, thing: Selection) -> Reading:
        """'stay south of y = 10'."""
        region = thing.one
        if not isinstance(region, Box):
            raise Unclear('to stay in what')
        beyond = outside(region)
        return Reading((StayIn(region=region) if beyond is None else Avoid(region=beyond),))

    def take(self, thing: Selection) -> Reading:
        """'take the middle aisle' is to drive along it, 'take the door' is to go through."""
        if isinstance(thing.one, (Half, Box)):
            return self.keep_to(thing)
        if isinstance(thing.one, Between):
            return visits((thing,))
        generic = generic_of(thing.place, place_nouns(thing.place))
        if generic == DOOR:
            return visits((thing,))
        if generic != PASSAGE:
            raise Unclear('to go through it or to stay in it')
        return self.keep_to(thing)

    def follow(self, *parts: Any) -> Reading:
        """'drive along the corridor', 'follow the wall'."""
        things: Things = parts[-1]
        thing = single(things)
        if thing.is_walls or (thing.places and thing.place.is_object):
            return self.stay_close(things)
        if thing.places and not isinstance(thing.one, Half):
            generic = generic_of(thing.place, place_nouns(thing.place))
            if generic != PASSAGE:
                raise Unclear('along it or through it')
        return self.keep_to(thing)

    def drive_on(self, thing: Selection) -> Reading:
        """'drive on the north side', 'drive on the north side of the rack'."""
        region = thing.one
        if not isinstance(region, Half):
            raise Unclear('to drive on what')
        return self.pass_half(thing) if region.of else self.keep_to(thing)

    def stay_close(self, things: Things) -> Reading:
        """'hug the walls'."""
        strip = strip_along(single(things), ALONG_WIDTH)
        return Reading((StayIn(SHOULD, region=strip),))

    def stay_within(self, metres: Token, things: Things) -> Reading:
        """'stay within 2 m of the walls'."""
        thing = single(things)
        if thing.is_point:
            return Reading((StayIn(region=with_radius(thing, positive(value(metres)))),))
        return Reading((StayIn(region=strip_along(thing, value(metres))),))

    # ---- pass

    def pass_at(self, things: Things, side: str) -> Reading:
        """'pass A on the north side'."""
        thing = single(things)
        if thing.is_positioned or thing.is_walls:
            raise Unclear('the side of the places or of the way')
        return Reading((Pass(region=thing.one, side=side),))

    def go_past(self, things: Things) -> Reading:
        """'drive past A' is to come near it, if it is an object or a point."""
        if len(things) == 1 and all_objects(things[0]) and isinstance(things[0].one, Half):
            return self.pass_half(things[0])
        if all(isinstance(region, Between) for thing in things for region in thing.regions):
            return visits(things)
        if any(thing.is_positioned for thing in things) or not all(
            thing.is_point or all_objects(thing) for thing in things
        ):
            raise Unclear('past it or through it')
        return visits(things)

    def pass_by_at(self, how: str, things: Things, *tokens: Token) -> Reading:
        """'pass by A on the north side'."""
        if how != 'PASSBY':
            raise Unclear('a side for what is visited')
        return self.pass_at(things, side_in(tokens))

    def pass_of(self, side: Token, thing: Selection) -> Reading:
        """'pass north of A'."""
        return self.pass_at((thing,), str(value(side)))

    def pass_above(self, thing: Selection) -> Reading:
        """'pass above A', on the map."""
        return self.pass_at((thing,), 'north')

    def pass_below(self, thing: Selection) -> Reading:
        """'pass below A', on the map."""
        return self.pass_at((thing,), 'south')

    def pass_half(self, thing: Selection) -> Reading:
        """'pass on the north side of A'."""
        region = thing.one
        if not isinstance(region, Half) or not region.of or not thing.place.is_object:
            raise Unclear('past it or through it')
        return Reading((Pass(region=NamedPlace(region.of), side=region.side),))

    def leave_at(self, thing: Selection, side: str) -> Reading:
        """'keep A on your left' is to pass it on its right."""
        return self.pass_at((thing,), OPPOSITE[side])

    def at_side(self, *tokens: Token) -> str:
        """'on the north side'."""
        return side_in(tuple(token for token in tokens if token is not None))

    own_side = at_side

    def at(self) -> None:
        """'on', 'to'."""

    # ---- the rest

    def end_at(self, thing: Selection) -> Reading:
        """'end in A'."""
        if thing.is_group and not thing.any_one:
            raise Unclear('in which of them')
        return Reading((EndAt(region=thing.one),))

    def bare(self, things: Things) -> Reading:
        """Things without a verb."""
        return Reading(things=things)
