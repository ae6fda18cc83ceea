"""Which files a bag is made of, in which order, and each as it was before it was compressed."""

from __future__ import annotations

import re
import shutil
from pathlib import Path, PurePath

import yaml
import zstandard

from llm_astar_msgs_adapter.bags.problems import Problems
from llm_astar_msgs_adapter.bags.records import BagError

FORMATS = ('.mcap', '.db3')
COMPRESSED = '.zstd'
METADATA = 'metadata.yaml'


def storage_files(path: Path, problems: Problems) -> list[Path]:
    """Return the storage files of a bag in their order. Raises BagError."""
    if not path.exists():
        raise BagError(f'{path}: there is no such bag')
    if path.is_file():
        if not _is_storage(path):
            known = ', '.join(FORMATS)
            raise BagError(f'{path}: a bag is a folder, or a file ending in one of {known}')
        return [path]
    held = sorted((item for item in path.iterdir() if _is_storage(item)), key=_natural)
    named, unusable = _named_files(path)
    if not held and not named:
        raise BagError(f'{path}: holds neither {METADATA} nor a file of {", ".join(FORMATS)}')
    found = [_named_so(name, held) for name in named]
    if held and not any(found):
        why = unusable or f'names {", ".join(named)}, and none of them is there'
        problems.note(
            f'{path / METADATA}: {why}; the files beside it are read in order of their names'
        )
        return held
    for name, file in zip(named, found):
        if file is None:
            problems.leave_out(f'{path / name}: is missing, though {METADATA} names it')
    later = [file for file in held if _follows(file, path / named[-1])]
    for file in later:
        problems.note(f'{file}: is read, though {METADATA} does not name it yet, as where a '
                      'recording goes on or was cut off')  # fmt: skip
    return [file for file in found if file is not None] + later


def _named_so(name: str, held: list[Path]) -> Path | None:
    """Return the file that goes by a name, itself or compressed, None where it is gone."""
    return next((file for file in held if file.name in (name, name + COMPRESSED)), None)


def _follows(file: Path, last: Path) -> bool:
    """Tell whether a file is a later one of the same split recording."""
    own, other = (re.split(r'(\d+)(?=\.)', path.name, maxsplit=1) for path in (file, last))
    return [own[0], *own[2:]] == [other[0], *other[2:]] and _natural(file) > _natural(last)


def _named_files(path: Path) -> tuple[list[str], str]:
    """Return the names of the files in metadata.yaml, or none and why."""
    file = path / METADATA
    if not file.exists():
        return [], 'is missing, as after a recording that was not ended'
    try:
        content = yaml.safe_load(file.read_text(encoding='utf-8'))
        names = content['rosbag2_bagfile_information']['relative_file_paths']
        found = list(dict.fromkeys(PurePath(name).name for name in names))
    except (OSError, ValueError, yaml.YAMLError, KeyError, TypeError, RecursionError) as error:
        why = ' '.join(str(error).split())
        return [], f'cannot be used ({type(error).__name__}: {why})'
    return found, '' if found else 'names no files'


def _is_storage(path: Path) -> bool:
    name = path.name.removesuffix(COMPRESSED)
    return path.is_file() and name.endswith(FORMATS)


def _natural(path: Path) -> list[tuple[int, str]]:
    """Return a key that puts bag_10 behind bag_9."""
    return [(int(part), '') if part.isdecimal() else (-1, part)
            for part in re.split(r'(\d+)', path.name)]  # fmt: skip


def bare_name(path: Path) -> str:
    """Return a bag's name: its folder's or its file's, without endings."""
    path = path.resolve()
    return path.name if path.is_dir() else PurePath(path.name.removesuffix(COMPRESSED)).stem


def unpack(path: Path, folder: Path, problems: Problems) -> Path:
    """Return a file that was compressed as a whole unpacked into `folder`, any other as it is."""
    if path.suffix != COMPRESSED:
        return path
    target = folder / path.stem
    with path.open('rb') as packed, target.open('wb') as file:
        try:
            shutil.copyfileobj(zstandard.ZstdDecompressor().stream_reader(packed), file)
        except zstandard.ZstdError as error:
            problems.leave_out(f'{path}: is damaged ({error}); the part before is read')
    return target
