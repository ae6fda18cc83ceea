"""A progress bar on stderr; plain lines, one a tenth, where stderr is no terminal."""

from __future__ import annotations

import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager

from tqdm import tqdm

# Steps between lines where the end is unknown.
UNKNOWN_STRIDE = 100


@contextmanager
def progress(total: int | None, unit: str = 'sample') -> Iterator[Callable[[], object]]:
    """Yield the function to call after each of `total` steps; None where nobody knows how many."""
    if sys.stderr.isatty():
        with tqdm(total=total, unit=unit, file=sys.stderr) as bar:
            yield lambda: bool(bar.update())
        return
    done = 0

    def step() -> None:
        nonlocal done
        done += 1
        if total is None:
            told, of = done % UNKNOWN_STRIDE == 0, ''
        else:
            told, of = done * 10 // total > (done - 1) * 10 // total, f' of {total}'
        if told:
            sys.stderr.write(f'{done}{of} {unit}s\n')
            sys.stderr.flush()

    yield step
