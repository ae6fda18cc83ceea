"""Maps in nav2_map_server's format: a yaml file and an image (pgm, png, bmp, ...).

A pixel's shade is the mean of its colours, 0 for black to 1 for white. Its occupancy is
1 - shade, or the shade itself with `negate`. The modes are those of map_server:

- `trinary`: occupied above occupied_thresh, free below free_thresh, unknown in between. An alpha
  channel counts as a fourth colour.
- `scale`: as `trinary`, but 0 to 100 in proportion in between; unknown where not opaque.
- `raw`: the shade times 255 is the occupancy, unknown above 100. `negate` has no effect.

The bottom row of the image is row 0 of the map.
"""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any

import numpy as np
import yaml
from numpy.typing import NDArray
from PIL import Image, UnidentifiedImageError

from llm_astar_msgs_adapter.errors import LlmAstarError, read_text
from llm_astar_msgs_adapter.maps.grid_map import (
    FREE,
    OCCUPIED,
    UNKNOWN,
    GridMap,
    GridMapError,
    Pose2D,
)

MODES = ('trinary', 'scale', 'raw')


class MapServerError(LlmAstarError, ValueError):
    """A map that cannot be loaded; the message names the file and the field."""


def load_map(path: str | Path, *, frame_id: str = 'map') -> GridMap:
    """Read a map_server yaml file and its image. Raises MapServerError, naming file and field."""
    path = Path(path)
    fields = read_yaml(path)
    for name in ('resolution', 'origin', 'occupied_thresh', 'free_thresh'):
        if name not in fields:
            raise MapServerError(f'{path}: {name}: is missing')
    resolution, occupied, free = (
        check_number(fields[name], f'{path}: {name}')
        for name in ('resolution', 'occupied_thresh', 'free_thresh')
    )
    origin = fields['origin']
    if not isinstance(origin, list) or len(origin) != 3:
        raise MapServerError(f'{path}: origin: [x, y, yaw] is expected, not {origin!r}')
    pose = Pose2D(*(check_number(item, f'{path}: origin') for item in origin))
    negate = fields.get('negate', 0)
    if negate not in (0, 1):
        raise MapServerError(f'{path}: negate: 0 or 1 is expected, not {negate!r}')
    mode = fields.get('mode', 'trinary')
    if mode not in MODES:
        raise MapServerError(f'{path}: mode: {mode!r} is not one of {", ".join(MODES)}')
    if not 0.0 <= free < occupied <= 1.0:
        raise MapServerError(
            f'{path}: free_thresh: {free} to occupied_thresh: {occupied} is not in 0 to 1'
        )
    image = fields.get('image')
    if not isinstance(image, str) or not image:
        raise MapServerError(f'{path}: image: a file name is expected, not {image!r}')
    pixels = read_image(path.parent / image, path)
    cells = pixels_to_cells(pixels, mode, negate=bool(negate), occupied=occupied, free=free)
    try:
        return GridMap(cells[::-1], resolution, pose, frame_id)
    except GridMapError as error:
        raise MapServerError(f'{path}: {error}') from None


def pixels_to_cells(
    pixels: NDArray[np.float64], mode: str, *, negate: bool, occupied: float, free: float
) -> NDArray[np.int8]:
    """Return the occupancy of pixels [height, width, 3 or 4], 0 to 255, in the same order."""
    channels = pixels if mode == 'trinary' else pixels[:, :, :3]
    shade = channels.mean(axis=2) / 255.0
    if mode == 'raw':
        value = np.rint(shade * 255.0)
        return np.where(value <= OCCUPIED, value, UNKNOWN).astype(np.int8)
    occupancy = shade if negate else 1.0 - shade
    between = np.full(occupancy.shape, float(UNKNOWN))
    if mode == 'scale':
        between = np.rint((occupancy - free) / (occupied - free) * 100.0)
    cells = np.where(occupancy < free, FREE, between)
    cells[occupancy > occupied] = OCCUPIED
    if mode == 'scale' and pixels.shape[2] == 4:
        cells[pixels[:, :, 3] != 255.0] = UNKNOWN
    return cells.astype(np.int8)


def read_yaml(path: Path) -> dict[str, Any]:
    """Return the fields of a yaml file. Raises MapServerError."""
    try:
        fields = yaml.safe_load(read_text(path, MapServerError))
    except yaml.YAMLError as error:
        raise MapServerError(f'{path}: not yaml: {" ".join(str(error).split())}') from None
    if not isinstance(fields, dict):
        raise MapServerError(f'{path}: the fields of a map are expected')
    return fields


def read_image(image: Path, path: Path) -> NDArray[np.float64]:
    """Return the pixels of an image [height, width, 3 or 4], 0 to 255. Raises MapServerError."""
    try:
        with Image.open(image) as picture:
            alpha = 'A' in picture.getbands() or 'transparency' in picture.info
            return np.asarray(picture.convert('RGBA' if alpha else 'RGB'), dtype=np.float64)
    except UnidentifiedImageError:
        raise MapServerError(f'{path}: image: {image} is not an image') from None
    except (OSError, ValueError, Image.DecompressionBombError) as error:
        reason = getattr(error, 'strerror', None) or error
        raise MapServerError(f'{path}: image: {image}: {reason}') from None


def check_number(value: object, name: str) -> float:
    """Return a finite number. Raises MapServerError, which begins with `name`."""
    if isinstance(value, bool) or not isinstance(value, (int, float)) or not math.isfinite(value):
        raise MapServerError(f'{name}: a number is expected, not {value!r}')
    return float(value)
