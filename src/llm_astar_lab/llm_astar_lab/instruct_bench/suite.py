# Copyright 2026 The LLM-A* for ROS 2 contributors
# SPDX-License-Identifier: Apache-2.0

"""Suites of route instructions with their truth and machine checks: the format, read and checked.

A suite is a JSON object; lengths are metres and points lie in the map's frame. On a barrier map
a cell is one metre wide and lattice point (x, y) lies at (x, y), so metres and cells are the same.

    {"version": 1, "note": "anything", "maps": {NAME: MAP, ...}, "instructions": [...]}

Fields that are not named here are ignored in the suite, its maps and its instructions, and
refused in checks and their regions, where a misspelt one would change the meaning.

MAP, all fields optional:
- `places`: {NAME: {"polygon": [[x, y], ...] or "point": [x, y], "aliases": [...],
  "kind": "area", "tags": [...]}}. A place of kind or tag `object` is visited by coming near it.
- `places_file`: a GeoJSON file of places, relative to the suite, instead of `places`. Without
  both, NAME.places.geojson or places.geojson beside the map's yaml, if there is one.
- `file`: a map_server yaml, relative to the suite.
- `dataset`, `id`: a barrier map of a dataset, relative to the suite or of the package's `maps/`.
Without `file` and `dataset`, a map NAME is NAME.yaml beside the suite or in a `--map-folder`,
and a map pN is map N of samples_1000.json.

INSTRUCTION, required: `id` (unique), `map`, `start`, `goal` ([x, y]), `text`; and, by default
empty: `lang` ("en"), `tags`, `style` ("templated" or "free"), `writer` (any name).
- `expect`: "ok" (default): can be met; "impossible": no path can; "contradiction": its clauses
  exclude each other; "none": it asks nothing of the route.
- `spec`: the truth, {"clauses": [...]} as in `instructions/route_spec.schema.json` (`via` with
  `region` is `visit`, a text is a place); "none" has none but `unknown` ones, the others at
  least one.
- `accept`: other specifications that count as exactly understood.
- `checks`: what a path that follows the instruction fulfils; "ok" has at least one. With
  "impossible" and "contradiction" no path fulfils all of them.

CHECK: {"check": KIND, ...}; every one may have `clause`, the index (from 0) of the clause of
`spec` that it belongs to (without it the check belongs to all clauses), and `least_possible` and
`note`, which are not read. Lengths are those of the path's own straight pieces.
- `inside_max`: `region`, `metres`: at most so much of the path lies inside the region; a stretch
  exactly on its edge is not inside.
- `outside_max`: `region`, `metres`: at most so much lies outside of it.
- `touch`: `region`, `tol` (0): the path comes within `tol` metres of the region; a negative `tol`
  is how deep inside it must come.
- `order`: `regions` (2 or more), `tol` (0): it touches them in this order, at other times too.
- `visit_before`: `first`, `second`, `tol` (0, of `first`): the path's first entry of `second`
  (more than its edge) comes after it touched `first`. Not entering `second` fulfils it.
- `visit_after`: `first`, `second`, `tol` (0, of `second`): the path touches `second` after it was
  in `first` for the last time. Not entering `first` fulfils it.
- `never_after`: `first`, `second`, `metres`: at most so much lies inside of `second` after the
  path's first entry of `first`.
- `entries`: `region`, `tol` (0), `apart`, and `at_least` (0), `at_most` or both: how often it
  comes to the region after it was more than `apart` metres away from it, or began.
- `end_in`: `region`, `tol` (0): the last point.
- `dist_min`: `region`, `metres`, `ends` (0): the path without its first and last `ends` metres
  keeps so far from the region.
- `wall_dist_min`: `metres`, `ends` (0): the same from all occupied cells of the map. Distances
  are to the squares of the cells, not to their centres.
- `cross`: `segment` [x0, y0, x1, y1], `times`: a number or "some" (1 or more): how often the path
  meets the segment. A stretch along it is one time; touching it is one, too.
- `length_max`: `of_direct` (the length is at most so many times that of the path without
  instruction), `metres`, or both.

REGION of a check:
- {"place": NAME or alias}: its polygon; a point is a disc of 0.5 m.
- {"tag": TAG}: all places of the kind or with the tag.
- {"circle": [x, y, radius]}, {"rect": [x0, y0, x1, y1]} (null: open), {"polygon": [[x, y], ...]}.
- {"half": "north", "of": NAME}: half of the map's extent, or of the place's bounding box within
  the place; `left` and `right`, without `of`: of the line from start to goal.
- {"union": [REGION, ...]}; {"between": [A, B]}: the convex hull of two regions without them.
- {"near": REGION, "width": W}: all within W metres of the region, itself included;
  {"walls": W}: all within W metres of occupied cells.

Two specifications ask the same where their normal forms are equal. There, places have their own
names instead of aliases, defaults are written out, boxes that reach the map's edge are open, one
avoided tag is each of its places (any of several regions each of these), and a distance to keep
from a region is a region to avoid with that margin. The order counts among visits alone. The words
of unknown parts and the questions of unsure clauses do not count.
"""

import math
from collections.abc import Hashable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from llm_astar_msgs_adapter.errors import raising, short_repr
from llm_astar_msgs_adapter.files import read_json
from llm_astar_planner.instructions import fields
from llm_astar_planner.instructions import regions as forms
from llm_astar_planner.instructions.clauses.avoid import Avoid
from llm_astar_planner.instructions.clauses.clause import Clause
from llm_astar_planner.instructions.clauses.keep_distance import KeepDistance
from llm_astar_planner.instructions.clauses.unknown import Unknown
from llm_astar_planner.instructions.clauses.visit import Visit
from llm_astar_planner.instructions.fields import SpecificationError
from llm_astar_planner.instructions.specification import Specification, from_json
from llm_astar_planner.search.result import Cell

from llm_astar_lab.instruct_bench.checks import Check, read_check
from llm_astar_lab.instruct_bench.maps import MapFinder, Scene, SuiteError, SuiteMap, as_list

VERSION = 1
OK, IMPOSSIBLE, CONTRADICTION, NONE = 'ok', 'impossible', 'contradiction', 'none'
EXPECTED = (OK, IMPOSSIBLE, CONTRADICTION, NONE)
STYLES = ('templated', 'free')
MAX_BYTES = 32_000_000
MAX_MAPS = 500
MAX_INSTRUCTIONS = 20_000
MAX_TEXT_CHARS = 10_000
MAX_CHECKS = 32
MAX_TAGS = 100
# Of lengths in metres: nobody asks for less than a centimetre.
DIGITS = 2
# What clauses say besides their regions.
FACTS = ('side', 'at_least', 'at_most')

# Visits in order, and the other clauses in any order.
NormalForm = tuple[tuple[Hashable, ...], frozenset[Hashable]]


@dataclass(frozen=True, eq=False)
class SuiteInstruction:
    """One instruction of a suite with its truth; `start` and `goal` are cells of its map."""

    id: str
    suite_map: SuiteMap
    start: Cell
    goal: Cell
    text: str
    lang: str
    tags: tuple[str, ...]
    style: str
    writer: str
    expect: str
    truth: Specification
    accepted: tuple[Specification, ...]
    checks: tuple[Check, ...]

    @property
    def clause_kinds(self) -> tuple[str, ...]:
        """The kinds of the truth's clauses, each once, in their order."""
        return tuple(dict.fromkeys(clause.kind for clause in self.truth.clauses))


@dataclass(frozen=True, eq=False)
class Suite:
    """A suite: where it was read from, and its instructions in the file's order."""

    path: Path
    instructions: tuple[SuiteInstruction, ...]

    def find(self, name: str) -> SuiteInstruction:
        """Return the instruction with an id. Raises SuiteError."""
        for instruction in self.instructions:
            if instruction.id == name:
                return instruction
        raise SuiteError(f'{self.path}: has no instruction {name!r}')


def load_suite(path: str | Path, folders: Sequence[Path] = ()) -> Suite:
    """Read and check a whole suite; `folders` are searched for its maps, too.

    Raises SuiteError, which names the file, the map or instruction, and the field.
    """
    path = Path(path)
    values = read_json(path, SuiteError, MAX_BYTES)
    if not isinstance(values, dict):
        raise SuiteError(f'{path}: a JSON object is expected')
    if values.get('version') != VERSION:
        version = short_repr(values.get('version'))
        raise SuiteError(f'{path}: version: {version} is not {VERSION}')
    entries = values.get('maps')
    if not isinstance(entries, dict) or not 1 <= len(entries) <= MAX_MAPS:
        raise SuiteError(f'{path}: maps: is not an object of 1 to {MAX_MAPS} maps')
    where = f'{path}: instructions'
    listed = as_list(values.get('instructions'), where, 1, MAX_INSTRUCTIONS, '')
    finder = MapFinder(path, folders)
    maps = {name: finder.load(name, entry) for name, entry in entries.items()}
    found: dict[str, SuiteInstruction] = {}
    for index, item in enumerate(listed):
        name = item.get('id') if isinstance(item, dict) else None
        which = f'instruction {short_repr(name) if isinstance(name, str) else f"at {index}"}'
        with raising(SuiteError, f'{path}: {which}: ', SuiteError, SpecificationError):
            instruction = read_instruction(fields.as_mapping(item, 'entry'), maps)
        if instruction.id in found:
            raise SuiteError(f'{path}: {which}: id: is used twice')
        found[instruction.id] = instruction
    return Suite(path, tuple(found.values()))


def read_instruction(values: Mapping[str, Any], maps: Mapping[str, SuiteMap]) -> SuiteInstruction:
    """Read an instruction. Raises SuiteError or SpecificationError, which name the field."""
    suite_map = maps[fields.as_choice(values.get('map'), 'map', list(maps))]
    ends = {name: read_point(values, name, suite_map) for name in ('start', 'goal')}
    text, writer = values.get('text'), values.get('writer')
    if not isinstance(text, str) or len(text) > MAX_TEXT_CHARS:
        raise SuiteError(f'text: is not a text of up to {MAX_TEXT_CHARS} characters')
    expect = fields.as_choice(values.get('expect', OK), 'expect', EXPECTED)
    truth = read_specification(values.get('spec'), 'spec', suite_map)
    if bool(truth.enforceable) == (expect == NONE):
        raise SuiteError(f'spec: {len(truth.enforceable)} clauses do not go with expect {expect}')
    tags = as_list(values.get('tags', []), 'instruction: tags', 0, MAX_TAGS, 'texts')
    accepted = as_list(values.get('accept', []), 'accept', 0, MAX_CHECKS, 'specifications')
    checks = as_list(values.get('checks', []), 'checks', 0, MAX_CHECKS, 'checks')
    if expect == OK and not checks:
        raise SuiteError('checks: an instruction that can be met has at least one')
    scene = Scene(suite_map, **ends)
    return SuiteInstruction(
        id=fields.as_text(values.get('id'), 'id'),
        suite_map=suite_map,
        **ends,
        text=text,
        lang=fields.as_text(values.get('lang', 'en'), 'lang'),
        tags=tuple(fields.as_text(tag, 'instruction: tags') for tag in tags),
        style=fields.as_choice(values.get('style') or '', 'style', ('', *STYLES)),
        writer=fields.as_text(writer, 'writer') if writer else '',
        expect=expect,
        truth=truth,
        accepted=tuple(
            read_specification(item, f'accept[{index}]', suite_map)
            for index, item in enumerate(accepted)
        ),
        checks=tuple(
            read_check(item, f'checks[{index}]', scene, len(truth.clauses))
            for index, item in enumerate(checks)
        ),
    )


def read_point(values: Mapping[str, Any], name: str, suite_map: SuiteMap) -> Cell:
    """Return the cell of start or goal. Raises SuiteError where it is off the map or occupied."""
    x, y = fields.as_numbers(values.get(name), name, 2)
    grid_map = suite_map.grid_map
    cell = grid_map.world_to_cell(x, y)
    if not grid_map.contains(cell):
        raise SuiteError(f'{name}: ({x:g}, {y:g}) lies off map {suite_map.name!r}')
    if grid_map.blocked()[cell[1], cell[0]]:
        raise SuiteError(f'{name}: ({x:g}, {y:g}) is occupied on map {suite_map.name!r}')
    return cell


def read_specification(value: object, where: str, suite_map: SuiteMap) -> Specification:
    """Read a specification whose places are all on the map. Raises SuiteError."""
    with raising(SuiteError, f'{where}: ', SuiteError, SpecificationError):
        specification = from_json(value)
        normal_form(specification, suite_map)
    return specification


def same_specification(
    specification: Specification, accepted: Iterable[Specification], suite_map: SuiteMap
) -> bool:
    """Tell whether a specification asks the same as one of the accepted ones."""
    try:
        found = normal_form(specification, suite_map)
    except ValueError:  # it names what is not on the map
        return False
    return any(found == normal_form(other, suite_map) for other in accepted)


def normal_form(specification: Specification, suite_map: SuiteMap) -> NormalForm:
    """Return the normal form. Raises SuiteError for a place or tag that the map does not have."""
    visits: list[Hashable] = []
    others: set[Hashable] = set()
    for clause in specification.clauses:
        keys = list(clause_keys(clause, suite_map))
        if isinstance(clause, Visit):
            visits += keys
        else:
            others.update(keys)
    return tuple(visits), frozenset(others)


def clause_keys(clause: Clause, suite_map: SuiteMap) -> Iterator[Hashable]:
    """Yield what a clause is compared by, several for an avoided tag. Raises SuiteError."""
    kind, strength = clause.kind, clause.strength
    match clause:
        case Unknown():
            yield kind
        case Avoid(region=forms.Along(place, width), margin=0.0) if place == forms.WALLS:
            yield KeepDistance.kind, strength, round(width, DIGITS)
        case KeepDistance(metres=metres, region=None):
            yield kind, strength, round(metres, DIGITS)
        case KeepDistance(metres=metres, region=forms.Region() as region):
            yield from avoid_keys(region, metres, strength, suite_map)
        case Avoid(region=region, margin=margin):
            yield from avoid_keys(region, margin, strength, suite_map)
        case Visit(regions=regions):
            yield kind, strength, frozenset(region_key(region, suite_map) for region in regions)
        case _:
            keys = (region_key(region, suite_map) for region in clause.regions)
            yield kind, strength, *keys, *(getattr(clause, name, None) for name in FACTS)


def avoid_keys(
    region: forms.Region, margin: float, strength: str, suite_map: SuiteMap
) -> Iterator[Hashable]:
    """Yield what an avoided region is compared by: each place of a tag, a disc with its margin."""
    if isinstance(region, forms.Disc):
        radius = region.radius + margin or forms.AVOID_RADIUS
        region, margin = forms.Disc(region.x, region.y, radius), 0.0
    for part in parts_of(region, suite_map):
        yield Avoid.kind, strength, region_key(part, suite_map), round(margin, DIGITS)


def parts_of(region: forms.Region, suite_map: SuiteMap) -> list[forms.Region]:
    """Return the regions that one joins: each place of a tag, without those that are excepted."""
    match region:
        case forms.Tagged(tag):
            return [forms.NamedPlace(name) for name in suite_map.tagged_names(tag, 'tag')]
        case forms.AnyOf(regions):
            return [part for one in regions for part in parts_of(one, suite_map)]
        case forms.Except(inner, others):
            within = parts_of(inner, suite_map)
            without = parts_of(forms.AnyOf(others), suite_map)
            keys = {region_key(part, suite_map) for part in without}
            if keys <= {region_key(part, suite_map) for part in within}:
                return [part for part in within if region_key(part, suite_map) not in keys]
    return [region]


def region_key(region: forms.Region, suite_map: SuiteMap) -> Hashable:
    """Return what a region is compared by. Raises SuiteError for an unknown place or tag."""
    own = suite_map.place_name
    parts = parts_of(region, suite_map)
    if parts != [region]:
        keys = frozenset(region_key(part, suite_map) for part in parts)
        return next(iter(keys)) if len(keys) == 1 else keys
    key: Hashable = region
    match region:
        case forms.NamedPlace(name):
            key = forms.NamedPlace(own(name, 'place'))
        case forms.AllOf(regions):
            key = forms.AllOf, frozenset(region_key(one, suite_map) for one in regions)
        case forms.Except(inner, others):
            without = region_key(forms.AnyOf(others), suite_map)
            key = forms.Except, region_key(inner, suite_map), without
        case forms.Disc(x, y, radius):
            values = (x, y, radius or forms.VISIT_RADIUS)
            key = forms.Disc(*(round(value, DIGITS) for value in values))
        case forms.Box():
            key = opened_box(region, suite_map)
        case forms.Half(side, of) if of:
            key = forms.Half(side, own(of, 'of'))
        case forms.Between(first, second):
            key = frozenset(own(name, 'between') for name in (first, second))
        case forms.Along(place, width):
            name = place if place == forms.WALLS else own(place, 'along')
            key = forms.Along(name, round(width, DIGITS))
    return key


def opened_box(box: forms.Box, suite_map: SuiteMap) -> forms.Box:
    """Return a box with the sides open that reach the map's edge, to within a cell."""
    cell, extent = suite_map.grid_map.resolution, suite_map.extent
    # The upper sides with the other sign, so that low is open for all.
    sides = (box.x0, box.y0, -box.x1, -box.y1)
    edges = (extent[0], extent[1], -extent[2], -extent[3])
    x0, y0, x1, y1 = (
        -math.inf if side <= edge + cell else round(side, DIGITS)
        for side, edge in zip(sides, edges)
    )
    return forms.Box(x0, y0, -x1, -y1)
