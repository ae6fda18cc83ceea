"""Which files a bag is made of, in which order, and each as it was before it was compressed."""

from __future__ import annotations

import re
import shutil
from pathlib import Path, PurePath

import yaml
import zstandard

from llm_astar_msgs_adapter.bag_file import BagError
from llm_astar_msgs_adapter.bag_problems import Problems

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
    named = _named_files(path, problems)
    if named is None:
        if not held:
            raise BagError(f'{path}: holds neither {METADATA} nor a file of {", ".join(FORMATS)}')
        return held
    files = []
    for name in named:
        found = next((f for f in held if f.name in (name, name + COMPRESSED)), None)
        if found is None:
            problems.leave_out(f'{path / name}: is missing, though {METADATA} names it')
        else:
            files.append(found)
    unnamed = [file for file in held if named and _follows(file, path / named[-1])]
    for file in unnamed:
        problems.note(f'{file}: is read, though {METADATA} does not name it yet, as where a '
                      'recording goes on or was cut off')  # fmt: skip
    return files + unnamed


def _follows(file: Path, last: Path) -> bool:
    """Tell whether a file is a later one of the same split recording."""
    own, other = (re.split(r'(\d+)(?=\.)', path.name, maxsplit=1) for path in (file, last))
    return [own[0], *own[2:]] == [other[0], *other[2:]] and _natural(file) > _natural(last)


def _named_files(path: Path, problems: Problems) -> list[str] | None:
    """Return the names of the files in metadata.yaml, None without a usable one."""
    file = path / METADATA
    if not file.exists():
        problems.note(f'{file}: is missing, as after a recording that was not ended; the files '
                      'beside it are read in order of their names')  # fmt: skip
        return None
    try:
        content = yaml.safe_load(file.read_text(encoding='utf-8'))
        names = content['rosbag2_bagfile_information']['relative_file_paths']
        return list(dict.fromkeys(PurePath(name).name for name in names))
    except (OSError, ValueError, yaml.YAMLError, KeyError, TypeError, RecursionError) as error:
        problems.note(f'{file}: cannot be used ({type(error).__name__}: {error}); the files '
                      'beside it are read in order of their names')  # fmt: skip
        return None


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
