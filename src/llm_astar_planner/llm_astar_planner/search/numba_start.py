"""Sets numba up in half of the time that it takes by itself, for processes that plan once."""

from __future__ import annotations

import importlib
import importlib.util
import sys
from types import ModuleType

from numba.core.registry import cpu_target

PACKAGE = 'scipy.linalg'


def start_numba() -> None:
    """Set numba up without importing the whole of scipy.linalg, which takes 0.2 s.

    Of that package numba takes only the compiled module `cython_blas`, so an empty package stands
    in its place meanwhile. Afterwards scipy.linalg can be imported as ever. Call it before other
    threads are started. Where scipy is missing or scipy.linalg
    imported already, numba sets itself up as ever.
    """
    if PACKAGE in sys.modules or importlib.util.find_spec('scipy') is None:
        cpu_target.target_context.refresh()
        return
    scipy = importlib.import_module('scipy')
    package = ModuleType(PACKAGE)
    package.__path__ = [f'{folder}/linalg' for folder in scipy.__path__]
    sys.modules[PACKAGE] = package
    try:
        cpu_target.target_context.refresh()
    finally:
        del sys.modules[PACKAGE]
