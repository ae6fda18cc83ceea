"""What clauses of a specification mean, on traces of points: an implementation of its own.

It reads the JSON form and shares nothing with the planner. A trace is a row of numbers of
points. Points are given once, as `Ground`; what is inside a region is then looked up.
"""

import json

import numpy as np
import shapely

AVOID_RADIUS, VISIT_RADIUS, OBJECT_REACH, END_RADIUS = 1.0, 0.5, 1.0, 0.5
OPPOSITE = {'north': 'south', 'east': 'west', 'left': 'right'}
OPPOSITE |= {other: side for side, other in OPPOSITE.items()}


class Ground:
    """Points [n, 2] on a map with places, a start and a goal: which points are in a region."""

    def __init__(self, world, points, start, goal):
        self.world = world
        self.points = np.asarray(points, dtype=float)
        self.start, self.goal = np.asarray(start, float), np.asarray(goal, float)
        self._shapes = shapely.points(self.points)
        self._known = {}

    def inside(self, region, *, reach):
        """Tell which points lie in a region; with `reach` in what counts as a visit of it."""
        key = json.dumps([region, reach], sort_keys=True)
        if key not in self._known:
            self._known[key] = self._inside(region, reach)
        return self._known[key]

    def within(self, region, metres):
        """Tell which points lie within some metres of a region."""
        if metres <= 0.0:
            return self.inside(region, reach=False)
        shape = self.shape(region)
        if shape is None:
            raise NotImplementedError(f'a distance from {region}')
        return shapely.distance(shape, self._shapes) <= metres

    def shape(self, region):
        """Return a region as a shapely geometry, None where it has none."""
        if isinstance(region, str):
            region = {'place': region}
        if 'place' in region:
            return self.place(region['place']).geometry
        if 'tag' in region:
            return shapely.union_all([place.geometry for place in self.tagged(region['tag'])])
        if 'point' in region:
            return shapely.Point(region['point']).buffer(region.get('radius') or 1e-3)
        if 'any_of' in region:
            return shapely.union_all([self.shape(part) for part in region['any_of']])
        return None

    def place(self, name):
        """Return a place by its name or an alias."""
        place = self.world.places.get(name)
        if place is None:
            raise LookupError(f'no place {name!r}')
        return place

    def tagged(self, tag):
        """Return the places of a kind or with a tag."""
        places = [place for place in self.world.places if tag.casefold() in kinds_of(place)]
        if not places:
            raise LookupError(f'no place with the tag {tag!r}')
        return places

    def _inside(self, region, reach):
        if isinstance(region, str):
            region = {'place': region}
        if 'except' in region:
            others = [self.inside(part, reach=False) for part in region['except']]
            return self.inside(region['region'], reach=reach) & ~np.any(others, axis=0)
        if 'any_of' in region:
            return np.any([self.inside(part, reach=reach) for part in region['any_of']], axis=0)
        if 'all_of' in region:
            return np.all([self.inside(part, reach=reach) for part in region['all_of']], axis=0)
        if 'place' in region:
            return self._in_place(self.place(region['place']), reach)
        if 'tag' in region:
            return np.any([self._in_place(p, reach) for p in self.tagged(region['tag'])], axis=0)
        if 'point' in region:
            radius = region.get('radius') or (VISIT_RADIUS if reach else AVOID_RADIUS)
            return self._near(region['point'], radius)
        if 'end' in region:
            return self._near(self.start if region['end'] == 'start' else self.goal, END_RADIUS)
        if 'between' in region:
            two = [self.place(name).geometry for name in region['between']]
            hull = shapely.union_all(two).convex_hull
            return self._covered(hull.difference(shapely.union_all(two)))
        if 'along' in region:
            width = region.get('width', 1.0)
            if region['along'] == 'walls':
                return self.wall_distance() <= width
            edge = self.place(region['along']).geometry
            return shapely.distance(edge, self._shapes) <= width
        if 'box' in region:
            low_x, low_y, high_x, high_y = (
                side if side is not None else limit
                for side, limit in zip(region['box'], (-np.inf, -np.inf, np.inf, np.inf))
            )
            x, y = self.points.T
            return (x >= low_x) & (x <= high_x) & (y >= low_y) & (y <= high_y)
        if 'half' in region:
            return self._in_half(region['half'], region.get('of'))
        raise NotImplementedError(f'the region {region}')

    def _covered(self, shape):
        shapely.prepare(shape)
        return shapely.covers(shape, self._shapes)

    def _in_place(self, place, reach):
        if place.is_object and reach:
            return shapely.distance(place.geometry, self._shapes) <= OBJECT_REACH
        return self._covered(place.geometry)

    def _near(self, point, radius):
        return np.hypot(*(self.points - np.asarray(point, float)).T) <= radius

    def _in_half(self, side, of):
        if side in ('left', 'right'):
            ahead = self.goal - self.start
            offset = self.points - self.start
            turn = ahead[0] * offset[:, 1] - ahead[1] * offset[:, 0]
            return turn >= 0.0 if side == 'left' else turn <= 0.0
        bounds = self.place(of).geometry.bounds if of else self.world.bounds
        x0, y0, x1, y1 = bounds
        x, y = self.points.T
        halves = {
            'north': y >= (y0 + y1) / 2,
            'south': y <= (y0 + y1) / 2,
            'east': x >= (x0 + x1) / 2,
            'west': x <= (x0 + x1) / 2,
        }
        return halves[side] & (self._covered(self.place(of).geometry) if of else True)

    def wall_distance(self):
        """Metres from each point to the nearest wall."""
        cells = self.world.grid_map.world_to_cells(self.points)
        height, width = self.world.grid_map.cells.shape
        x, y = cells[:, 0].clip(0, width - 1), cells[:, 1].clip(0, height - 1)
        return self.world.wall_distance[y, x]


def kinds_of(place):
    """Return the kind and tags of a place, folded."""
    return {word.casefold() for word in (place.kind, *place.tags)}


class Traces:
    """Many traces over a Ground: `steps`, int [n, length], and `alive`, bool of that shape.

    What points do not have is drawn for each trace: the distance that it keeps from walls, and
    on which side it passes a thing.
    """

    def __init__(self, ground, steps, alive, seed=0, clearance=None, passed=None):
        self.ground, self.steps, self.alive = ground, steps, alive
        self.seed = seed
        draw = np.random.default_rng(seed)
        self.clearance = draw.uniform(0.0, 2.5, len(steps)) if clearance is None else clearance
        self.passed = passed

    def table(self, points):
        """Return what holds at points as a table over the traces."""
        return points[self.steps] & self.alive

    def visits(self, region):
        """Return where traces visit a region."""
        return self.table(self.ground.inside(region, reach=True))

    def enters(self, region):
        """Return where traces are in a region."""
        return self.table(self.ground.inside(region, reach=False))

    def side(self, region, side):
        """Tell which traces pass a thing on a side: drawn, but never on both sides."""
        if self.passed is not None:
            return self.passed(region, side)
        first = min(side, OPPOSITE[side])
        key = sum(map(ord, json.dumps([region, first], sort_keys=True)))
        coin = np.random.default_rng((self.seed, key)).integers(0, 3, len(self.steps))
        return coin == (1 if side == first else 2)


def keeps(clauses, traces):
    """Tell which traces keep all clauses of a specification, in JSON: bool [traces]."""
    visits = [clause['regions'] for clause in clauses if clause['kind'] == 'visit']
    kept = visited_in_order(visits, traces)
    for clause in clauses:
        kept &= keeps_one(clause, traces)
    return kept


def keeps_one(clause, traces):
    """Tell which traces keep one clause."""
    everyone = np.ones(len(traces.steps), dtype=bool)
    kind = clause['kind']
    match kind:
        case 'visit':
            return visited_in_order([clause['regions']], traces)
        case 'unknown' | 'unsupported':
            return everyone
        case 'avoid':
            inside = traces.ground.within(clause['region'], clause.get('margin', 0.0))
            return ~traces.table(inside).any(axis=1)
        case 'keep_distance':
            if clause['from'] == 'walls':
                return traces.clearance >= clause['metres'] - 1e-9
            near = traces.ground.within(clause['from'], clause['metres'] - 1e-6)
            return ~traces.table(near).any(axis=1)
        case 'stay_in':
            return stays(traces.enters(clause['region']), traces.alive)
        case 'pass':
            return traces.side(clause.get('region', clause.get('object')), clause['side'])
        case 'end_at':
            last = traces.alive.sum(axis=1) - 1
            return traces.visits(clause['region'])[np.arange(len(last)), last]
        case 'count':
            return counted(clause, traces)
    first, second = clause['first'], clause['second']
    match kind:
        case 'before':
            seen = np.logical_or.accumulate(traces.visits(first), axis=1)
            return ~(traces.enters(second) & ~seen).any(axis=1)
        case 'never_after':
            seen = np.logical_or.accumulate(traces.enters(first), axis=1)
            return ~(traces.enters(second) & seen).any(axis=1)
        case 'then':
            later = traces.visits(second)[:, ::-1]
            later = np.logical_or.accumulate(later, axis=1)[:, ::-1]
            return ~(traces.enters(first) & ~later).any(axis=1)
    raise NotImplementedError(f'the clause {kind}')


def stays(inside, alive):
    """Tell which traces are inside from the first time to the last, and there is one."""
    first = inside.argmax(axis=1)
    last = inside.shape[1] - 1 - inside[:, ::-1].argmax(axis=1)
    positions = np.arange(inside.shape[1])
    between = (positions >= first[:, None]) & (positions <= last[:, None]) & alive
    return inside.any(axis=1) & ~(between & ~inside).any(axis=1)


def counted(clause, traces):
    """Tell which traces enter a region as often as a clause says."""
    inside = traces.visits(clause['region'])
    before = np.pad(inside[:, :-1], ((0, 0), (1, 0)))
    entries = (inside & ~before).sum(axis=1)
    most = clause.get('at_most')
    return (entries >= clause.get('at_least', 0)) & (entries <= (99 if most is None else most))


def visited_in_order(groups, traces):
    """Tell which traces visit the regions of each group, after those of the groups before."""
    count, length = traces.steps.shape
    earliest = np.zeros(count, dtype=int)
    for group in groups:
        tables = [traces.visits(region) for region in group]
        open_from = np.arange(length)[None, :] >= earliest[:, None]
        for table in tables:
            ahead = table & open_from
            found = np.where(ahead.any(axis=1), ahead.argmax(axis=1), length)
            earliest = np.maximum(earliest, found)
    return earliest < length
