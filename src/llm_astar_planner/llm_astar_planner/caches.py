# Copyright 2026 The LLM-A* for ROS 2 contributors
# SPDX-License-Identifier: Apache-2.0

"""Memories of a bounded size: what was not used for longest makes way."""

import threading
from collections import OrderedDict
from collections.abc import Callable, Hashable
from functools import wraps
from typing import Any, ParamSpec, TypeVar

_K = TypeVar('_K', bound=Hashable)
_V = TypeVar('_V')
_P = ParamSpec('_P')


class Recent(OrderedDict[_K, _V]):
    """The entries that were set, or asked for by `get`, last. Not thread-safe.

    Together they cost at most `size`: one each, or what `cost` says of a value. The newest is kept
    whatever it costs.
    """

    def __init__(self, size: int, cost: Callable[[_V], int] | None = None) -> None:
        """Start empty."""
        super().__init__()
        self._size, self._cost = size, cost

    def get(self, key: _K, default: Any = None) -> _V | Any:  # noqa: ANN401 - as a dict's
        """Return an entry, or the default."""
        if key in self:
            self.move_to_end(key)
        return super().get(key, default)

    def __setitem__(self, key: _K, value: _V) -> None:
        """Set an entry; the oldest ones make way."""
        super().__setitem__(key, value)
        self.move_to_end(key)
        while len(self) > 1 and self._total() > self._size:
            self.popitem(last=False)

    def _total(self) -> int:
        return len(self) if self._cost is None else sum(map(self._cost, self.values()))


def cached(
    size: int, key: Callable[..., Hashable], cost: Callable[[Any], int] | None = None
) -> Callable[[Callable[_P, _V]], Callable[_P, _V]]:
    """Remember a function's results, each by the key of its arguments. Thread-safe.

    `size` and `cost` are those of `Recent`.
    """

    def decorate(function: Callable[_P, _V]) -> Callable[_P, _V]:
        known: Recent[Hashable, _V] = Recent(size, cost)
        lock = threading.Lock()

        @wraps(function)
        def remembered(*args: _P.args, **kwargs: _P.kwargs) -> _V:
            name = key(*args, **kwargs)
            with lock:
                if name in known:
                    return known.get(name)
            result = function(*args, **kwargs)
            with lock:
                return known.setdefault(name, result)

        return remembered

    return decorate
