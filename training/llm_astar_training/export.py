"""Write the network's weights as the numpy file that the package reads."""

from __future__ import annotations

import json
from dataclasses import asdict
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from llm_astar_training.network import Network

FORMAT = 1


def export(network: Network, path: Path) -> None:
    """Write weights as float16 by their torch names, and `shape` as JSON, into one .npz."""
    arrays = {
        name: value.detach().cpu().numpy().astype(np.float16)
        for name, value in network.state_dict().items()
    }
    header = json.dumps({'format': FORMAT, **asdict(network.shape)}, sort_keys=True)
    np.savez_compressed(path, header=np.frombuffer(header.encode(), np.uint8), **arrays)
