"""Maps of benchmarks that were made for language models, as a file for `llm-astar bench --map`.

`python -m benchmarks.llm_maps gtb traversal_benchmark.json out/gtb.json` reads a file that the
user has, and writes the maps with their samples:

- GameTraversalBenchmark (arXiv 2410.07765): `traversal_benchmark.json`. Each map's character walks
  from its place to its objectives in their order: a sample for each stretch of the way.
- PPNL (arXiv 2310.03249): the JSON files of its worlds with one goal.
- GridRoute (arXiv 2505.24306): `dataset.csv`.

Their own paths move along rows and columns only; ours also along diagonals that cut no corner, so
the same samples have paths, and their published lengths are not compared with ours.
"""

from __future__ import annotations

import argparse
import csv
import io
import re
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from llm_astar_msgs_adapter.errors import LlmAstarError, expect
from llm_astar_msgs_adapter.files import read_json, read_text
from llm_astar_msgs_adapter.maps.barrier_map import Point, Sample
from llm_astar_msgs_adapter.maps.grid_dataset import GridProblem
from llm_astar_msgs_adapter.maps.grid_map import FREE, OCCUPIED, GridMap
from llm_astar_msgs_adapter.maps.problem_maps import save_maps

MAX_SIDE, MAX_BYTES = 1000, 64_000_000
# Of a world of PPNL.
OBSTACLE, START, GOAL = 1, 2, 3
# A map as it is read: what is blocked, in rows, and one sample's start and goal.
Entry = tuple[list[list[bool]], Point, Point]
Reader = Callable[[Any], Iterator[Entry]]


class LlmBenchmarkError(LlmAstarError, ValueError):
    """A file of another benchmark cannot be read; the message names it and the entry."""


def load_llm_benchmark(name: str, path: Path) -> list[GridProblem]:
    """Read GTB, PPNL or GRIDROUTE; samples on equal maps that follow each other share one.

    Raises LlmBenchmarkError that names the file and the entry.
    """
    found: list[GridProblem] = []
    for where, (rows, start, goal) in enumerate_entries(name, path):
        height, width = len(rows), len(rows[0])
        if max(height, width) > MAX_SIDE or any(len(row) != width for row in rows):
            raise LlmBenchmarkError(f'{where}: rows of one length to {MAX_SIDE} are expected')
        if not all(0 <= x < width and 0 <= y < height for x, y in (start, goal)):
            raise LlmBenchmarkError(f'{where}: start or goal is outside of the map')
        cells = np.where(np.array(rows, dtype=bool), OCCUPIED, FREE).astype(np.int8)
        samples: tuple[Sample, ...] = (Sample(start, goal),)
        if found and np.array_equal(found[-1].grid_map.cells, cells):
            samples = (*found.pop().samples, *samples)
        found.append(GridProblem(len(found), GridMap(cells, 1.0), samples, family=name))
    if not found:
        raise LlmBenchmarkError(f'{path}: has no maps')
    return found


def enumerate_entries(name: str, path: Path) -> Iterator[tuple[str, Entry]]:
    """Yield the samples of a file, each with where it is. Raises LlmBenchmarkError."""
    for number, item in enumerate(read_items(name, path)):
        where = f'{path}: entry {number}'
        try:
            found = list(READERS[name](item))
        except (KeyError, TypeError, ValueError, IndexError, AttributeError) as error:
            raise LlmBenchmarkError(f'{where}: is not as {name} writes it: {error!r}') from None
        yield from ((where, entry) for entry in found if entry[1] != entry[2])


def read_items(name: str, path: Path) -> list[Any]:
    """Return the rows or objects of a file. Raises LlmBenchmarkError."""
    if name == GRIDROUTE:
        text = read_text(path, LlmBenchmarkError, limit=MAX_BYTES).removeprefix('\ufeff')
        return list(csv.DictReader(io.StringIO(text)))
    items = read_json(path, LlmBenchmarkError)
    return expect(items, list, str(path), 'a JSON list', LlmBenchmarkError)


def read_gtb(item: dict[str, Any]) -> Iterator[Entry]:
    """Yield the way of a map's character from one objective to the next; rows may be short."""
    rows = item['environment'].split('\n')
    width = max(map(len, rows))
    (at,) = ((x, y) for y, row in enumerate(rows) for x, tile in enumerate(row) if tile == '@')
    walkable = {*re.findall(r"'(.)'", item['walkable_tiles']), '@'}
    places = [(int(x), int(y)) for _, y, x in item['objectives'].values()]
    # Four objectives of the published file lie outside of their maps.
    stops = [(x, y) for x, y in places if 0 <= x < width and 0 <= y < len(rows)]
    blocked = [[tile not in walkable for tile in row.ljust(width)] for row in rows]
    for x, y in stops:
        blocked[y][x] = False
    for stop in stops:
        yield blocked, at, stop
        at = stop


def read_ppnl(item: dict[str, Any]) -> Iterator[Entry]:
    """Yield the one sample of a world."""
    world = item['world']
    places = {tile: (x, y) for y, row in enumerate(world) for x, tile in enumerate(row)}
    yield [[tile == OBSTACLE for tile in row] for row in world], places[START], places[GOAL]


def read_gridroute(item: dict[str, str]) -> Iterator[Entry]:
    """Yield the sample of a row."""
    side = int(item['matrix_size'])
    if not 0 < side <= MAX_SIDE:
        raise ValueError(f'matrix_size {side} is not 1 to {MAX_SIDE}')
    blocked = [[False] * side for _ in range(side)]
    for x, y in re.findall(r'\((\d{1,4}), (\d{1,4})\)', item['all_obstacle_coords']):
        blocked[int(y)][int(x)] = True
    start, goal = ((int(item[f'{end}_x']), int(item[f'{end}_y'])) for end in ('start', 'end'))
    yield blocked, start, goal


GTB, PPNL, GRIDROUTE = 'gtb', 'ppnl', 'gridroute'
READERS: dict[str, Reader] = {GTB: read_gtb, PPNL: read_ppnl, GRIDROUTE: read_gridroute}


def main(argv: Sequence[str] | None = None) -> int:
    """Write the maps of a benchmark as a dataset; return 0. Raises LlmBenchmarkError."""
    parser = argparse.ArgumentParser(
        'python -m benchmarks.llm_maps', description=str(__doc__).partition('\n')[0]
    )
    parser.add_argument('name', choices=READERS)
    parser.add_argument('file', type=Path)
    parser.add_argument('out', type=Path)
    args = parser.parse_args(argv)
    maps = load_llm_benchmark(args.name, args.file)
    args.out.parent.mkdir(parents=True, exist_ok=True)
    save_maps(maps, args.out)
    print(f'{args.out}: {len(maps)} maps, {sum(len(item.samples) for item in maps)} samples')
    return 0


if __name__ == '__main__':
    raise SystemExit(main())
