"""Write a trained network as the file that the planner's waypoint model reads."""

from __future__ import annotations

import json
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
from llm_astar_planner.search.arrays import Float32s
from llm_astar_planner.waypoints.learned import FORMAT


def write_weights(path: Path, arrays: Mapping[str, Float32s], shape: Mapping[str, int]) -> None:
    """Write weights as float16 under their torch names, and the network's sizes, to one .npz."""
    halves: dict[str, Any] = {name: array.astype(np.float16) for name, array in arrays.items()}
    header = json.dumps({'format': FORMAT, **shape}, sort_keys=True)
    np.savez_compressed(path, header=np.frombuffer(header.encode(), np.uint8), **halves)
