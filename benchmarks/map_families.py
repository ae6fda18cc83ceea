"""Families of maps drawn from a generator: bool [size, size], True where blocked."""

from __future__ import annotations

from collections.abc import Callable
from itertools import pairwise

import numpy as np
from llm_astar_lab.datasets.generate import maze, rooms
from llm_astar_planner.search.arrays import Bools


def boxes(size: int, random: np.random.Generator) -> Bools:
    """Return an open area with boxes of 5 to 60 cells a side, one per 4000 cells."""
    blocked = np.zeros((size, size), dtype=np.bool_)
    for _ in range(size * size // 4000):
        x, y = random.integers(0, size, 2)
        width, height = random.integers(5, 60, 2)
        blocked[y : y + height, x : x + width] = True
    return blocked


def city(size: int, random: np.random.Generator) -> Bools:
    """Return blocks of houses with courtyards between streets of 6 to 14 cells, and parks."""
    blocked = np.zeros((size, size), dtype=np.bool_)
    rows, columns = (np.cumsum(random.integers(28, 90, size // 28)).tolist() for _ in range(2))
    blocks = [(*y, *x) for y in pairwise([0, *rows]) for x in pairwise([0, *columns])]
    for top, bottom, left, right in blocks:
        street = int(random.integers(6, 15))
        house = blocked[top : bottom - street, left : right - street]
        if house.size == 0 or random.random() < 0.1:
            continue
        house[:] = True
        for _ in range(int(random.integers(0, 4))):
            y, x = random.integers(0, house.shape)
            house[y : y + random.integers(6, 30), x : x + random.integers(6, 30)] = False
    return blocked


def random_40(size: int, random: np.random.Generator) -> Bools:
    """Return cells that are blocked at random, 40 % of them."""
    return random.random((size, size)) < 0.4


def warehouse(size: int, random: np.random.Generator) -> Bools:
    """Return rows of racks with aisles of 10 cells, cross aisles, and pallets left in the way."""
    blocked = np.zeros((size, size), dtype=np.bool_)
    for top in range(30, size - 40, 26):
        for left in range(20, size - 20, 112):
            if random.random() < 0.95:
                blocked[top : top + 16, left : left + 100] = True
    for y, x in random.integers(0, size, (size * size // 8000, 2)):
        blocked[y : y + 6, x : x + 6] = True
    return blocked


FAMILIES: dict[str, Callable[[int, np.random.Generator], Bools]] = {
    'rooms': rooms,
    'random 40 %': random_40,
    'maze': maze,
    'city': city,
    'warehouse': warehouse,
    'boxes': boxes,
}
