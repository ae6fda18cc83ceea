"""Requests whose path arrives as arrays, without a Python object for each pose.

rclpy makes some 17 objects of each pose, which takes 18 us: 40 ms for a path of 2,000 poses, of
the 20 ms that a behaviour tree waits for `is_path_valid`. Here the message is read as it lies in
memory before rclpy converts it. Its layout is that of the C structs which rosidl generates.
"""

from __future__ import annotations

import contextlib
import ctypes
from dataclasses import dataclass
from importlib.metadata import version
from types import SimpleNamespace
from typing import Any

import numpy as np
from geometry_msgs.msg import Point, Pose, PoseStamped, Quaternion
from nav_msgs.msg import Path
from numpy.typing import NDArray
from rclpy.serialization import deserialize_message, serialize_message
from rclpy.type_support import check_for_type_support
from std_msgs.msg import Header

# A PoseStamped: stamp, the address, length and capacity of the frame's name, and the pose.
POSE = np.dtype(
    [('stamp', '2i4'), ('frame', 'u8'), ('length', 'u8'), ('room', 'u8'), ('pose', '7f8')]
)


class Sequence(ctypes.Structure):
    """A string or a sequence as rosidl_runtime_c has it."""

    _fields_ = [
        ('data', ctypes.c_void_p),
        ('size', ctypes.c_size_t),
        ('capacity', ctypes.c_size_t),
    ]


class PathStruct(ctypes.Structure):
    """A nav_msgs/Path."""

    _fields_ = [
        ('sec', ctypes.c_int32),
        ('nanosec', ctypes.c_uint32),
        ('frame_id', Sequence),
        ('poses', Sequence),
    ]


# The major versions of rclpy that this was tried with: those of Jazzy and of Kilted.
TRIED = ('7', '9')
# What the fields of a request may be. One of another type is not read here.
KINDS = {
    'nav_msgs/Path': PathStruct,
    'string': Sequence,
    'boolean': ctypes.c_bool,
    'uint8': ctypes.c_uint8,
    'double': ctypes.c_double,
}


@dataclass(frozen=True, eq=False)
class CompactPath:
    """A path: its frame, the frame of each pose, and the poses [n, 7] (x, y, z and quaternion)."""

    frame_id: str
    frames: tuple[str, ...]
    values: NDArray[np.float64]

    @classmethod
    def of_message(cls, path: Path) -> CompactPath:
        """Read a nav_msgs/Path."""
        frames = tuple(pose.header.frame_id for pose in path.poses)
        values = [
            (at.x, at.y, at.z, turn.x, turn.y, turn.z, turn.w)
            for at, turn in ((each.pose.position, each.pose.orientation) for each in path.poses)
        ]
        array = np.array(values, dtype=np.float64).reshape(-1, 7)
        return cls(path.header.frame_id, frames, array)

    @classmethod
    def of_struct(cls, struct: PathStruct) -> CompactPath:
        """Read a path as it lies in memory."""
        count = struct.poses.size
        content = ctypes.string_at(struct.poses.data, count * POSE.itemsize) if count else b''
        poses = np.frombuffer(content, POSE)
        names = zip(poses['frame'].tolist(), poses['length'].tolist())
        frames = tuple(text_at(address, length) for address, length in names)
        frame_id = text_at(struct.frame_id.data, struct.frame_id.size)
        return cls(frame_id, frames, np.ascontiguousarray(poses['pose']))


def compact_path(path: CompactPath | Path | None) -> CompactPath:
    """Return the path of a request in any form; one that could not be read is empty."""
    if path is None:
        return CompactPath('', (), np.zeros((0, 7)))
    return path if isinstance(path, CompactPath) else CompactPath.of_message(path)


def text_at(address: int | None, length: int) -> str:
    """Return the text at an address."""
    return ctypes.string_at(address or 0, length).decode(errors='replace') if length else ''


def compact_type(kind: Any) -> Any:  # noqa: ANN401 - a message type
    """Return a type to receive messages of `kind` as, whose paths are CompactPath.

    Raises KeyError for a message with fields that are not read here.
    """
    check_for_type_support(kind)
    names = {name: KINDS[field] for name, field in kind.get_fields_and_field_types().items()}
    struct: Any = type('Struct', (ctypes.Structure,), {'_fields_': list(names.items())})

    def read(address: int) -> Any:  # noqa: ANN401 - the message
        # An exception must not leave a function that C calls.
        values = dict.fromkeys(names)
        with contextlib.suppress(Exception):
            message = struct.from_address(address)
            values = {name: value_of(getattr(message, name)) for name in names}
        return SimpleNamespace(**values)

    function = ctypes.PYFUNCTYPE(ctypes.py_object, ctypes.c_void_p)(read)
    new_capsule = ctypes.pythonapi.PyCapsule_New
    new_capsule.restype = ctypes.py_object
    new_capsule.argtypes = [ctypes.c_void_p, ctypes.c_char_p, ctypes.c_void_p]
    capsule = new_capsule(ctypes.cast(function, ctypes.c_void_p), None, None)
    # By these names rclpy finds how to convert; `_read` keeps the function alive.
    metaclass = type('Compact', (type(kind),), {'_CONVERT_TO_PY': capsule, '_read': function})
    return metaclass(f'Compact{kind.__name__}', (), {})


def value_of(field: Any) -> Any:  # noqa: ANN401 - of any of KINDS
    """Return the value of a field of a struct."""
    if isinstance(field, PathStruct):
        return CompactPath.of_struct(field)
    return text_at(field.data, field.size) if isinstance(field, Sequence) else field


def compact_service(kind: Any) -> Any:  # noqa: ANN401 - a service type
    """Return a service type as `kind` whose requests are compact.

    That is `kind` itself where it fails, and with versions of rclpy that this was not tried with:
    memory of another layout could end the process.
    """
    try:
        if version('rclpy').partition('.')[0] not in TRIED:
            return kind
        compact = compact_type(kind.Request)
        if not is_read_rightly(kind.Request, compact):
            return kind
        return type(kind)(kind.__name__, (kind,), {'Request': compact})
    except Exception:  # noqa: BLE001 - another rclpy may have other insides
        return kind


def is_read_rightly(kind: Any, compact: Any) -> bool:  # noqa: ANN401 - message types
    """Tell whether a path in a message of `kind` is read as it was written."""
    poses = [
        PoseStamped(
            header=Header(frame_id='f' * n),
            pose=Pose(
                position=Point(x=1.0 + n, y=2.0, z=3.0),
                orientation=Quaternion(x=4.0, y=5.0, z=6.0, w=7.0 + n),
            ),
        )
        for n in range(3)
    ]
    path = Path(header=Header(frame_id='map'), poses=poses)
    message = kind()
    names = kind.get_fields_and_field_types()
    for name in [name for name, field in names.items() if field == 'nav_msgs/Path']:
        setattr(message, name, path)
        found = getattr(deserialize_message(serialize_message(message), compact), name)
        expected = CompactPath.of_message(path)
        if (found.frame_id, found.frames) != (expected.frame_id, expected.frames):
            return False
        if not np.array_equal(found.values, expected.values):
            return False
    return True
