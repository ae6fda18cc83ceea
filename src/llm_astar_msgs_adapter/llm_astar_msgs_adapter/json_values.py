"""Reads JSON that somebody else wrote: bounded in values and depth."""

from __future__ import annotations

import json
from typing import Any

# Signs that begin or follow a value; each value takes up to 300 bytes as Python's.
SIGNS = '[{,'
MAX_VALUES = 800_000


def parse_json(text: str | bytes) -> Any:  # noqa: ANN401 - any JSON value
    """Return a JSON value. Raises ValueError, also where it is too deep or has too many values."""
    count = sum(
        text.count(sign) if isinstance(text, str) else text.count(sign.encode()) for sign in SIGNS
    )
    if count > MAX_VALUES:
        raise ValueError(f'over {MAX_VALUES} values')
    try:
        return json.loads(text)
    except RecursionError:
        raise ValueError('is nested too deeply') from None
