# Copyright 2026 The LLM-A* for ROS 2 contributors
# SPDX-License-Identifier: Apache-2.0

"""The maps that the page offers: the shipped ones and those of the user."""

from base64 import b64decode
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from tempfile import TemporaryDirectory

import yaml
from llm_astar_msgs_adapter.errors import LlmAstarError
from llm_astar_msgs_adapter.files import read_yaml
from llm_astar_msgs_adapter.maps.barrier_map import BarrierMap, Point
from llm_astar_msgs_adapter.maps.grid_map import GridMap
from llm_astar_msgs_adapter.maps.map_server import FORMATS
from llm_astar_msgs_adapter.maps.places import Places
from llm_astar_msgs_adapter.maps.problem_maps import BARE_MAP, YAML, ProblemMap, load_maps
from llm_astar_planner.cli.map_files import open_places
from llm_astar_planner.resources import SAMPLES_FILE, find_file
from PIL import Image

# What the page can still draw and the server plan on while somebody waits.
MAX_CELLS = 4_000_000
# Maps taken of one file, and start-goal pairs of one map.
MAX_MAPS = 10
MAX_PAIRS = 10
# Maps dropped onto the page that are kept, the newest, and what an image without a yaml is.
MAX_DROPPED = 10
DROPPED = 'dropped/'
BARE_IMAGE = b'{resolution: 0.05, origin: [0, 0, 0], occupied_thresh: 0.65, free_thresh: 0.196}'
# The files in maps/ that the page offers, those of robots first.
SUITE = ('house', 'office', 'warehouse', 'museum', 'market', 'ward', 'workshop')
INDOORS = (f'instructions/{name}.yaml' for name in SUITE)
SHIPPED = ('demo.json', 'depot.yaml', 'hospital.yaml', *INDOORS, SAMPLES_FILE)


class PlayError(LlmAstarError, ValueError):
    """A request that cannot be served: one sentence with the fix, and the HTTP status.

    `field` names the field of the request, '' where none is at fault.
    """

    def __init__(self, message: str, field: str = '', status: int = 422) -> None:
        """Take the sentence, the field and the status."""
        super().__init__(message)
        self.field = field
        self.status = status


@dataclass(frozen=True)
class PlayMap:
    """One map of the page.

    `file` and `map_id` are what `--map` and `--map-id` of `llm-astar plan` take; `map_id` is None
    where the file holds one map only.
    """

    id: str
    name: str
    file: str
    map_id: int | None
    problem: ProblemMap
    grid_map: GridMap
    places: Places

    @property
    def barriers(self) -> BarrierMap | None:
        """The barriers, where the map is given by them."""
        return self.problem if isinstance(self.problem, BarrierMap) else None

    @property
    def is_metric(self) -> bool:
        """Whether its points are given in metres: on maps of robots, from map_server."""
        return Path(self.file).suffix.lower() in YAML

    def pairs(self) -> list[tuple[Point, Point]]:
        """Return the first start-goal pairs, in cells."""
        to_cell, samples = self.problem.to_cell, self.problem.samples[:MAX_PAIRS]
        return [(to_cell(sample.start), to_cell(sample.goal)) for sample in samples]


class Maps:
    """The maps by id, in the order in which the page lists them."""

    def __init__(self, files: Sequence[str] = ()) -> None:
        """Load the user's files and then the shipped ones.

        Raises what reading a file raises, and PlayError for one that is too large.
        """
        self._maps: dict[str, PlayMap] = {}
        for file in (*files, *SHIPPED):
            for play_map in read_maps(file):
                self._maps.setdefault(play_map.id, play_map)

    def __iter__(self) -> Iterator[PlayMap]:
        """Iterate over the maps."""
        return iter(tuple(self._maps.values()))

    def drop(self, files: object) -> PlayMap:
        """Take a map that is dropped onto the page, and return it; thread-safe. Raises PlayError.

        `files` are the contents of files by name, in base64.
        """
        try:
            contents = {name: b64decode(text) for name, text in dict(files).items()}  # type: ignore[call-overload]
        except (TypeError, ValueError):
            raise PlayError('files are expected: {name: contents in base64}', 'map') from None
        dropped = dropped_map(contents)
        self._maps.pop(dropped.id, None)
        for key in [key for key in self._maps if key.startswith(DROPPED)][: 1 - MAX_DROPPED]:
            self._maps.pop(key, None)
        self._maps[dropped.id] = dropped
        return dropped

    def get(self, map_id: str) -> PlayMap:
        """Return the map with an id. Raises PlayError (404) where there is none."""
        play_map = self._maps.get(map_id)
        if play_map is None:
            known = ', '.join(list(self._maps)[:20])
            raise PlayError(f'map: there is no map {map_id[:80]!r}; there is {known}', 'map', 404)
        return play_map


def dropped_map(files: Mapping[str, bytes]) -> PlayMap:
    """Return the map of an image, and of its yaml where it is there, by their names.

    The image is the one that was dropped, whatever the yaml calls it. Raises PlayError.
    """
    names = sorted(files, key=lambda name: Path(name).suffix.lower() not in YAML)
    are_yaml = [Path(name).suffix.lower() in YAML for name in names]
    if are_yaml not in ([False], [True, False]):
        what = 'drop an image, or a yaml together with its image'
        raise PlayError(f'{what}, not {", ".join(names)[:200] or "nothing"}', 'map')
    named, image_name = names[0], names[-1]
    with TemporaryDirectory() as folder:
        path, image = Path(folder, 'map.yaml'), Path(folder, 'image')
        image.write_bytes(files[image_name])
        path.write_bytes(files[named] if are_yaml[0] else BARE_IMAGE)
        try:
            with Image.open(image, formats=FORMATS) as picture:
                check_size(image_name, *picture.size)
            fields = read_yaml(path, PlayError)
            if isinstance(fields, dict):
                path.write_text(yaml.safe_dump(fields | {'image': image.name}))
            found = next(read_maps(str(path)))
        except (LlmAstarError, OSError, Image.DecompressionBombError) as error:
            problem = str(error).replace(str(path), named).replace(str(image), image_name)
            raise PlayError(problem, 'map') from None
    name = Path(named).stem
    return replace(found, id=DROPPED + named, name=name, file=f'{name}.yaml')


def check_size(file: str, width: int, height: int) -> None:
    """Raise PlayError for a map with more cells than the page can show."""
    if width * height > MAX_CELLS:
        what = f'{width} x {height} cells are over the {MAX_CELLS} that the page can show'
        raise PlayError(f'{file}: {what}; cut out or coarsen the map')


def read_maps(file: str) -> Iterator[PlayMap]:
    """Yield the first maps of a file, a path or a name in maps/; raises as `Maps` does."""
    path = find_file(file, 'maps')
    file = file if Path(file).suffix else path.name  # a shipped map by its short name
    scenarios = Path(f'{path}.scen')
    if path.suffix.lower() in BARE_MAP and scenarios.is_file():
        file, path = f'{file}.scen', scenarios
    places = open_places('', str(path))
    problems = load_maps(path, MAX_PAIRS)
    several = len(problems) > 1
    for problem in problems[:MAX_MAPS]:
        grid_map = problem.to_grid()
        check_size(file, grid_map.width, grid_map.height)
        key, name, map_id = file, path.name.split('.')[0], None
        if several:
            key, name, map_id = f'{file}:{problem.id}', f'{name}, map {problem.id}', problem.id
        yield PlayMap(key, name, file, map_id, problem, grid_map, places)
