# Copyright 2026 The LLM-A* for ROS 2 contributors
# SPDX-License-Identifier: Apache-2.0

"""Maps in nav2_map_server's format: a yaml file and an image (pgm, png, bmp, ...).

A pixel's shade is the mean of its colours, 0 for black to 1 for white. Its occupancy is
1 - shade, or the shade itself with `negate`. The modes are those of map_server:

- `trinary`: occupied above occupied_thresh, free below free_thresh, unknown in between. An alpha
  channel counts as a fourth colour.
- `scale`: as `trinary`, but 0 to 100 in proportion in between; unknown where not opaque.
- `raw`: the shade times 255 is the occupancy, unknown above 100. `negate` has no effect.

The bottom row of the image is row 0 of the map.
"""

import sys
import warnings
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any, TypeAlias

import numpy as np
from numpy.typing import NDArray
from PIL import Image, UnidentifiedImageError

from llm_astar_msgs_adapter.errors import LlmAstarError, raising, short_repr, shortened
from llm_astar_msgs_adapter.files import read_yaml
from llm_astar_msgs_adapter.maps.grid_map import (
    FREE,
    MAX_CELLS,
    OCCUPIED,
    UNKNOWN,
    GridMap,
    GridMapError,
    Pose2D,
)

# What a map is made of: one, a yaml file, an image as map_server takes it, or an array.
MapLike: TypeAlias = 'GridMap | str | Path | Image.Image | NDArray[Any]'
MODES = ('trinary', 'scale', 'raw')
FORMATS = ('PPM', 'PNG', 'BMP', 'JPEG')
# Characters of a file's name in errors.
MAX_NAME = 500
# Pixels that are converted at a time: about 20 MB.
STRIP_PIXELS = 2**19


class MapServerError(LlmAstarError, ValueError):
    """A map that cannot be loaded; the message names the file and the field."""


def load_map(path: str | Path, *, frame_id: str = 'map') -> GridMap:
    """Read a map_server yaml file and its image. Raises MapServerError, naming file and field."""
    path = Path(path)
    fields = read_yaml(path, MapServerError)
    if not isinstance(fields, dict):
        raise MapServerError(f'{path}: the fields of a map are expected')
    for name in ('resolution', 'origin', 'occupied_thresh', 'free_thresh'):
        if name not in fields:
            raise MapServerError(f'{path}: {name}: is missing')
    resolution, occupied, free = (
        check_number(fields[name], f'{path}: {name}')
        for name in ('resolution', 'occupied_thresh', 'free_thresh')
    )
    origin = fields['origin']
    if not isinstance(origin, list) or len(origin) != 3:
        raise MapServerError(f'{path}: origin: [x, y, yaw] is expected, not {short_repr(origin)}')
    pose = Pose2D(*(check_number(item, f'{path}: origin') for item in origin))
    negate = fields.get('negate', 0)
    if negate not in (0, 1):
        raise MapServerError(f'{path}: negate: 0 or 1 is expected, not {short_repr(negate)}')
    mode = fields.get('mode', 'trinary')
    if not isinstance(mode, str) or mode not in MODES:
        raise MapServerError(f'{path}: mode: {short_repr(mode)} is not one of {", ".join(MODES)}')
    if not 0.0 <= free < occupied <= 1.0:
        words = f'free_thresh: {free} to occupied_thresh: {occupied} is not in 0 to 1'
        raise MapServerError(f'{path}: {words}')
    image = fields.get('image')
    if not isinstance(image, str) or not image:
        raise MapServerError(f'{path}: image: a file name is expected, not {short_repr(image)}')
    shades = Shades(mode, negate=bool(negate), occupied=occupied, free=free)
    cells = read_image(path.parent / image, path, shades)
    with raising(MapServerError, f'{path}: ', GridMapError):
        return GridMap(cells[::-1], resolution, pose, frame_id)


def to_grid_map(source: MapLike) -> GridMap:
    """Return a map of a yaml file, an image, or an array of occupancy or of obstacles.

    An array [height, width] is bool, True where there is an obstacle, or has the values of
    GridMap; row 0 is at the bottom, as there. An image has its bottom row there and map_server's
    thresholds. Both have cells of 1 m. Raises MapServerError, GridMapError.
    """
    if isinstance(source, GridMap):
        return source
    if isinstance(source, (str, Path)):
        return load_map(source)
    if isinstance(source, Image.Image):
        return GridMap(np.concatenate([Shades().cells(strip) for strip in strips(source)])[::-1])
    cells = np.asarray(source)
    return GridMap(np.where(cells, OCCUPIED, FREE) if cells.dtype == np.bool_ else cells)


@dataclass(frozen=True)
class Shades:
    """What the shades of an image mean: the mode and the thresholds of the yaml file."""

    mode: str = 'trinary'
    negate: bool = False
    occupied: float = 0.65
    free: float = 0.196

    def cells(self, pixels: NDArray[np.float64]) -> NDArray[np.int8]:
        """Return the occupancy of pixels [height, width, 3 or 4], 0 to 255, in the same order."""
        channels = pixels if self.mode == 'trinary' else pixels[:, :, :3]
        shade = channels.mean(axis=2) / 255.0
        if self.mode == 'raw':
            value = np.rint(shade * 255.0)
            return np.where(value <= OCCUPIED, value, UNKNOWN).astype(np.int8)
        occupancy = shade if self.negate else 1.0 - shade
        between = np.full(occupancy.shape, float(UNKNOWN))
        if self.mode == 'scale':
            between = np.rint((occupancy - self.free) / (self.occupied - self.free) * 100.0)
        cells = np.where(occupancy < self.free, FREE, between)
        cells[occupancy > self.occupied] = OCCUPIED
        if self.mode == 'scale' and pixels.shape[2] == 4:
            cells[pixels[:, :, 3] != 255.0] = UNKNOWN
        return cells.astype(np.int8)


def read_image(image: Path, path: Path, shades: Shades) -> NDArray[np.int8]:
    """Return the occupancy of an image [height, width]. Raises MapServerError.

    `path` is the yaml file, for errors. The image is converted in strips, so that it takes at
    most six bytes a cell.
    """
    try:
        if image.exists() and not image.is_file():
            raise MapServerError(f'{path}: image: {image}: is not a regular file')
        # By its contents, whatever its name; other formats may start other programs.
        with warnings.catch_warnings():
            # Pillow warns of large images: there is a limit here.
            warnings.simplefilter('ignore', Image.DecompressionBombWarning)
            with Image.open(image, formats=FORMATS) as picture:
                if picture.width * picture.height > MAX_CELLS:
                    raise MapServerError(f'{path}: image: {image}: is over {MAX_CELLS} pixels')
                return np.concatenate([shades.cells(strip) for strip in strips(picture)])
    except UnidentifiedImageError:
        known = ', '.join(FORMATS)
        raise MapServerError(f'{path}: image: {image} is not an image of {known}') from None
    except MapServerError:
        raise
    except Exception as error:  # noqa: BLE001 - whatever a damaged image leads to in Pillow
        reason = getattr(error, 'strerror', None) or str(error) or 'is damaged'
        shown = shortened(str(image), MAX_NAME)
        raise MapServerError(f'{path}: image: {shown}: {reason}') from None


def strips(picture: Image.Image) -> Iterator[NDArray[np.float64]]:
    """Yield the pixels of an image [rows, width, 3 or 4], 0 to 255, from the top down."""
    alpha = 'A' in picture.getbands() or 'transparency' in picture.info
    rows = max(1, STRIP_PIXELS // picture.width)
    for top in range(0, picture.height, rows):
        box = (0, top, picture.width, min(top + rows, picture.height))
        strip = picture.crop(box).convert('RGBA' if alpha else 'RGB')
        yield np.asarray(strip, dtype=np.float64)


def check_number(value: Any, name: str) -> float:  # noqa: ANN401 - any yaml value
    """Return a finite number. Raises MapServerError, which begins with `name`."""
    # In this order: a whole number of 400 digits has no float.
    is_number = isinstance(value, (int, float)) and not isinstance(value, bool)
    if is_number and abs(value) <= sys.float_info.max:
        return float(value)
    raise MapServerError(f'{name}: a number is expected, not {short_repr(value)}')
