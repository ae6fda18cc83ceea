# Copyright 2026 The LLM-A* for ROS 2 contributors
# SPDX-License-Identifier: Apache-2.0

"""Imports of large libraries that wait for their first use."""

import importlib
from typing import Any


class LazyModule:
    """A module that is imported when an attribute of it is first asked for."""

    def __init__(self, name: str) -> None:
        """Take the full name of the module."""
        self._name = name

    def __getattr__(self, attribute: str) -> Any:  # noqa: ANN401 - of any module
        """Return an attribute of the module. Raises ImportError, AttributeError."""
        return getattr(importlib.import_module(self._name), attribute)


# A fifth of a second and a tenth; most plans need none of them. numba takes a seventh, and half a
# second more when it loads its first kernel.
ndimage: Any = LazyModule('scipy.ndimage')
shapely: Any = LazyModule('shapely')
numba: Any = LazyModule('numba')
