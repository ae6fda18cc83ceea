"""The keys of many rows, 8 bytes each: their order, the last of equal ones, which are finished."""

from __future__ import annotations

from array import array
from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from llm_astar_lab.results.row import RowKey, Variant

# Map, pair, scale, number of the variant, and position in the file.
WIDTH = 5


@dataclass(frozen=True)
class RowKeys:
    """The keys of rows, 40 bytes each, in the order of map, pair and scale.

    `stored` [n, 5] has map, pair, scale, index in `variants` and position of every row of a
    file; `order` [m] the indices of the rows that count: the last of those with equal keys.
    """

    stored: NDArray[np.int64]
    order: NDArray[np.intp]
    variants: tuple[Variant, ...]

    @classmethod
    def of(cls, keys: Iterable[tuple[int, RowKey]]) -> RowKeys:
        """Take positions and keys in the order of a file."""
        numbers = array('q')
        variants: dict[Variant, int] = {}
        for position, (map_id, pair, scale, variant) in keys:
            index = variants.setdefault(variant, len(variants))
            numbers.extend((map_id, pair, scale, index, position))
        stored = np.frombuffer(numbers, np.int64).reshape(-1, WIDTH)
        last = last_of_equal(stored[:, :4])
        by_sample = np.lexsort([stored[:, column][last] for column in (2, 1, 0)])
        return cls(stored, last[by_sample], tuple(variants))

    @property
    def positions(self) -> NDArray[np.int64]:
        """The position [m] of each row that counts."""
        return self.stored[:, 4][self.order]

    def column(self, index: int) -> NDArray[np.int64]:
        """Return map, pair, scale or the index of the variant [m] of each row that counts."""
        return self.stored[:, index][self.order]


def last_of_equal(keys: NDArray[np.int64]) -> NDArray[np.intp]:
    """Return the indices, ascending, of the rows of `keys` [n, k] that no later one equals."""
    order = np.lexsort(keys.T)  # stable: equal rows stay in their order
    is_last = np.zeros(len(keys), dtype=np.bool_)
    is_last[-1:] = True
    # Column by column: all keys in order would take as much memory again.
    for column in keys.T:
        ordered = column[order]
        is_last[:-1] |= ordered[1:] != ordered[:-1]
    return np.sort(order[is_last])


class FinishedRows:
    """The keys of the rows that an earlier run finished, 8 bytes a row."""

    def __init__(self, keys: RowKeys | None = None) -> None:
        """Take the keys, of no row by default."""
        known = RowKeys.of(()) if keys is None else keys
        samples = np.stack([known.column(index) for index in range(3)], axis=1)
        self._values = [np.unique(column) for column in samples.T]
        packed, _ = self._pack(samples)
        variants = known.column(3)
        self._packed = {
            variant: np.sort(packed[variants == index])
            for index, variant in enumerate(known.variants)
        }

    def __len__(self) -> int:
        """Return the number of rows."""
        return sum(map(len, self._packed.values()))

    def __contains__(self, key: object) -> bool:
        """Tell whether the row with this RowKey is finished."""
        if not isinstance(key, tuple):
            return False
        *sample, variant = key
        return bool(self.mask(np.array([sample], dtype=np.int64), variant)[0])

    def mask(self, samples: NDArray[np.int64], variant: Variant) -> NDArray[np.bool_]:
        """Tell for `samples` [n, 3] (map, pair, scale) which are finished with a variant."""
        finished = self._packed.get(variant)
        if finished is None or not len(finished):
            return np.zeros(len(samples), dtype=np.bool_)
        packed, known = self._pack(samples)
        places = np.searchsorted(finished, packed).clip(max=len(finished) - 1)
        return np.asarray(known & (finished[places] == packed))

    def _pack(self, samples: NDArray[np.int64]) -> tuple[NDArray[np.int64], NDArray[np.bool_]]:
        """Return one number for each of `samples` [n, 3], and which have known values only."""
        packed, known = np.zeros(len(samples), np.int64), np.ones(len(samples), np.bool_)
        for values, column in zip(self._values, samples.T):
            if not len(values):
                continue
            places = np.searchsorted(values, column).clip(max=len(values) - 1)
            known &= values[places] == column
            packed = packed * len(values) + places
        return packed, known
