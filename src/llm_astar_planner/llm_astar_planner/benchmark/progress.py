"""A progress bar on stderr; plain lines, one a tenth, where stderr is no terminal."""

from __future__ import annotations

import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager

from tqdm import tqdm


@contextmanager
def progress(total: int, unit: str = 'sample') -> Iterator[Callable[[], object]]:
    """Yield the function to call after each of `total` steps."""
    if sys.stderr.isatty():
        with tqdm(total=total, unit=unit, file=sys.stderr) as bar:
            yield lambda: bool(bar.update())
        return
    done = 0

    def step() -> None:
        nonlocal done
        done += 1
        if done * 10 // total > (done - 1) * 10 // total:
            sys.stderr.write(f'{done} of {total} {unit}s\n')
            sys.stderr.flush()

    yield step
