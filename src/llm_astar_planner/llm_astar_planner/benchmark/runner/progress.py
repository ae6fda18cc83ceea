"""A progress bar on stderr, or plain lines where stderr is not a terminal."""

from __future__ import annotations

import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager

from tqdm import tqdm

# Steps between two lines where the total is unknown.
UNKNOWN_STRIDE = 100


@contextmanager
def progress(total: int | None, unit: str = 'sample') -> Iterator[Callable[[], object]]:
    """Yield the function to call after each of `total` steps; None where the total is unknown.

    Without a terminal a line is written after every tenth of the steps.
    """
    if sys.stderr.isatty():
        with tqdm(total=total, unit=unit, file=sys.stderr) as bar:
            yield lambda: bool(bar.update())
        return
    done = 0

    def step() -> None:
        nonlocal done
        done += 1
        if total is None:
            is_due, of_total = done % UNKNOWN_STRIDE == 0, ''
        else:
            is_due, of_total = done * 10 // total > (done - 1) * 10 // total, f' of {total}'
        if is_due:
            sys.stderr.write(f'{done}{of_total} {unit}s\n')
            sys.stderr.flush()

    yield step
