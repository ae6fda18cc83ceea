"""Suites of route instructions with their truth and machine checks: the format, read and checked.

A suite is a JSON object; lengths are metres and points lie in the map's frame. On a barrier map
a cell is one metre wide and lattice point (x, y) lies at (x, y), so metres and cells are the same.

    {"version": 1, "note": "anything", "maps": {NAME: MAP, ...}, "instructions": [...]}

Fields that are not named here are ignored in the suite, its maps and its instructions, and
refused in checks and their regions, where a misspelt one would change the meaning.

MAP, all fields optional:
- `places`: {NAME: {"polygon": [[x, y], ...] or "point": [x, y], "aliases": [...],
  "kind": "area", "tags": [...]}}. A place of kind or tag `object` is visited by coming near it.
- `places_file`: a GeoJSON file of places, relative to the suite, instead of `places`.
- `file`: a map_server yaml, relative to the suite.
- `dataset`, `id`: a barrier map of a dataset, relative to the suite or of the package's `maps/`.
Without `file` and `dataset`, a map NAME is NAME.yaml beside the suite or in a `--map-folder`,
and a map pN is map N of samples_1000.json.

INSTRUCTION, required: `id` (unique), `map`, `start`, `goal` ([x, y]), `text`; and, by default
empty: `lang` ("en"), `tags`, `style` ("templated" or "free"), `writer` (any name).
- `expect`: "ok" (default): can be met; "impossible": no path can; "contradiction": its clauses
  exclude each other; "none": it asks nothing of the route.
- `spec`: the truth, {"clauses": [...]} as in `instructions/route_spec.schema.json` (`via` with
  `region` is `visit`, a text is a place); "none" has no clauses, the others at least one.
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
"""
