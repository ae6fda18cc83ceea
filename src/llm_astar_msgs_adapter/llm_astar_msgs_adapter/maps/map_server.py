"""Maps in nav2_map_server's format: a yaml file beside an image (pgm, png, bmp, ...).

A pixel's shade is the mean of its colours, 0 black to 1 white; it is occupied by 1 - shade, or
by the shade itself where `negate`. Mode `trinary` (alpha, where there is one, counts as a fourth
colour): occupied above occupied_thresh, free below free_thresh, unknown in between. `scale`: in
between 0 to 100 in proportion, and unknown where the pixel is not opaque. `raw`: the shade of
255 itself, unknown above 100, whatever `negate` says. The image's bottom row is the map's row 0.
"""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any

import numpy as np
import yaml
from numpy.typing import NDArray
from PIL import Image, UnidentifiedImageError

from llm_astar_msgs_adapter.maps.grid_map import (
    FREE,
    OCCUPIED,
    UNKNOWN,
    GridMap,
    GridMapError,
    Pose2D,
)

MODES = ('trinary', 'scale', 'raw')


class MapServerError(ValueError):
    """A map that cannot be loaded; the message names the file and the field."""


def load_map(path: str | Path, *, frame_id: str = 'map') -> GridMap:
    """Read a map_server yaml file and its image. Raises MapServerError, naming file and field."""
    path = Path(path)
    fields = _read_yaml(path)
    resolution = _number(fields, 'resolution', path)
    origin = _origin(fields, path)
    occupied = _number(fields, 'occupied_thresh', path)
    free = _number(fields, 'free_thresh', path)
    negate = _flag(fields, path)
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
    pixels = _read_image(path.parent / image, path)
    cells = _cells(pixels, mode, negate=negate, occupied=occupied, free=free)
    try:
        return GridMap(cells[::-1], resolution, origin, frame_id)
    except GridMapError as error:
        raise MapServerError(f'{path}: {error}') from None


def _cells(
    pixels: NDArray[np.float64],
    mode: str,
    *,
    negate: bool,
    occupied: float,
    free: float,
) -> NDArray[np.int8]:
    """Turn pixels [height, width, 3 or 4], 0 to 255, into occupancy in the image's row order."""
    channels = pixels if mode == 'trinary' else pixels[:, :, :3]
    shade = channels.mean(axis=2) / 255.0
    if mode == 'raw':
        value = np.rint(shade * 255.0)
        return np.where(value <= OCCUPIED, value, UNKNOWN).astype(np.int8)
    share = shade if negate else 1.0 - shade
    between = np.full(share.shape, float(UNKNOWN))
    if mode == 'scale':
        between = np.rint((share - free) / (occupied - free) * 100.0)
    cells = np.where(share > occupied, OCCUPIED, np.where(share < free, FREE, between))
    if mode == 'scale' and pixels.shape[2] == 4:
        cells[pixels[:, :, 3] != 255.0] = UNKNOWN
    return cells.astype(np.int8)


def _read_yaml(path: Path) -> dict[str, Any]:
    try:
        fields = yaml.safe_load(path.read_text(encoding='utf-8'))
    except OSError as error:
        raise MapServerError(f'{path}: {error.strerror or error}') from None
    except (yaml.YAMLError, UnicodeDecodeError) as error:
        raise MapServerError(f'{path}: not yaml: {" ".join(str(error).split())}') from None
    if not isinstance(fields, dict):
        raise MapServerError(f'{path}: the fields of a map are expected')
    return fields


def _read_image(image: Path, path: Path) -> NDArray[np.float64]:
    """Return an image's pixels [height, width, channels], 0 to 255: colours, and alpha if any."""
    try:
        with Image.open(image) as picture:
            alpha = 'A' in picture.getbands() or 'transparency' in picture.info
            return np.asarray(picture.convert('RGBA' if alpha else 'RGB'), dtype=np.float64)
    except UnidentifiedImageError:
        raise MapServerError(f'{path}: image: {image} is no picture') from None
    except (OSError, ValueError, Image.DecompressionBombError) as error:
        reason = getattr(error, 'strerror', None) or error
        raise MapServerError(f'{path}: image: {image}: {reason}') from None


def _number(fields: dict[str, Any], name: str, path: Path) -> float:
    if name not in fields:
        raise MapServerError(f'{path}: {name}: is missing')
    value = fields[name]
    if isinstance(value, bool) or not isinstance(value, (int, float)) or not math.isfinite(value):
        raise MapServerError(f'{path}: {name}: a number is expected, not {value!r}')
    return float(value)


def _origin(fields: dict[str, Any], path: Path) -> Pose2D:
    value = fields.get('origin')
    if not isinstance(value, list) or len(value) != 3:
        raise MapServerError(f'{path}: origin: [x, y, yaw] is expected, not {value!r}')
    for item in value:
        if isinstance(item, bool) or not isinstance(item, (int, float)):
            raise MapServerError(f'{path}: origin: a number is expected, not {item!r}')
    return Pose2D(*(float(item) for item in value))


def _flag(fields: dict[str, Any], path: Path) -> bool:
    value = fields.get('negate', 0)
    if value not in (0, 1):
        raise MapServerError(f'{path}: negate: 0 or 1 is expected, not {value!r}')
    return bool(value)
