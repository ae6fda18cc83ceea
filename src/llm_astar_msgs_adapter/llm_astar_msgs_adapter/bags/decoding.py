"""Messages of bags as values: by the definitions a bag brings along, else by Jazzy's."""

from __future__ import annotations

from collections.abc import Mapping
from contextlib import suppress
from typing import Any

import zstandard
from rosbags.interfaces import Nodetype
from rosbags.serde import SerdeError
from rosbags.typesys import (
    Stores,
    TypesysError,
    get_types_from_idl,
    get_types_from_msg,
    get_typestore,
)
from rosbags.typesys.store import Typestore

from llm_astar_msgs_adapter.bags.records import Channel, unzstd
from llm_astar_msgs_adapter.bags.types import bag_types

ZSTD_MAGIC = b'\x28\xb5\x2f\xfd'
# What parsing a definition that somebody else wrote may raise.
DEFINITION_ERRORS = (
    TypesysError, KeyError, ValueError, TypeError, AssertionError, IndexError, RecursionError,
)  # fmt: skip
# Code is made for every element of such an array.
MAX_ELEMENTS = 10_000


class DecodeError(ValueError):
    """A message that is not what its type says."""


class UnknownTypeError(ValueError):
    """A message type that neither Jazzy nor the bag defines; the message names it."""


class Decoder:
    """Decodes the messages of one bag."""

    def __init__(self) -> None:
        """Know Jazzy's types alone."""
        self._embedded = get_typestore(Stores.EMPTY)
        self._names: dict[str, str] = {}

    def learn(self, channel: Channel) -> None:
        """Take up a type's definition from the bag; without a usable one, Jazzy's counts."""
        if not channel.definition or channel.msgtype in self._names:
            return
        with suppress(*DEFINITION_ERRORS):
            types = _parse(channel)
            name = _own_name(channel.msgtype, types)
            known = self._embedded.fielddefs
            self._embedded.register({n: type_ for n, type_ in types.items() if n not in known})
            # Compiled now, so that a type of unknown parts counts as unknown.
            self._embedded.get_msgdef(name)
            self._names[channel.msgtype] = name

    def knows(self, msgtype: str) -> bool:
        """Tell whether messages of a type can be decoded."""
        return msgtype in self._names or msgtype in bag_types().types

    def decode(self, msgtype: str, data: bytes) -> Any:  # noqa: ANN401 - of the message's type
        """Return a message, its fields as attributes, arrays as numpy's.

        Raises DecodeError for data that does not fit the type, UnknownTypeError for the type.
        """
        data = _unpacked(data)
        try:
            name, store = self._type(msgtype)
            return store.deserialize_cdr(data, name)
        except SerdeError as error:
            raise DecodeError(str(error)) from None
        except DEFINITION_ERRORS as error:
            message = f'its type {msgtype} is unknown here and the bag does not define it'
            raise UnknownTypeError(f'{message} ({error})') from None

    def _type(self, msgtype: str) -> tuple[str, Typestore]:
        if msgtype in self._names:
            return self._names[msgtype], self._embedded
        return msgtype, bag_types()


def _parse(channel: Channel) -> dict[str, Any]:
    """Return the types in a definition by name."""
    if channel.format != 'ros2idl':
        return _bounded(get_types_from_msg(channel.definition, channel.msgtype))
    types: dict[str, Any] = {}
    bar = '=' * 80 + '\n'
    for part in channel.definition.split(bar):
        text = part.split('\n', 1)[1] if part.startswith('IDL: ') else part
        if text.strip():
            types.update(get_types_from_idl(text))
    return _bounded(types)


def _bounded(types: Mapping[str, Any]) -> dict[str, Any]:
    """Return the types of a definition. Raises ValueError for arrays that no message has."""
    for name, (_, fields) in types.items():
        for field, (kind, detail) in fields:
            if kind is Nodetype.ARRAY and detail[1] > MAX_ELEMENTS and not _is_plain(detail[0]):
                message = f'{name}: {field}: {detail[1]} elements'
                raise ValueError(message)
    return dict(types)


def _is_plain(element: Any) -> bool:  # noqa: ANN401 - a parse tree of rosbags
    """Tell whether an element is a number, of which arrays are read at once."""
    kind, detail = element
    return kind is Nodetype.BASE and detail[0] not in ('string', 'wstring')


def _unpacked(data: bytes) -> bytes:
    """Return a message as it was before it was compressed. Raises DecodeError."""
    if data[:4] != ZSTD_MAGIC:
        return data
    try:
        return unzstd(data)
    except (ValueError, zstandard.ZstdError) as error:
        raise DecodeError(str(error)) from None


def _own_name(msgtype: str, types: dict[str, Any]) -> str:
    """Return the name a type was parsed under: services' parts come out as messages.

    Raises KeyError where the definition is another's, or a service's events lack their fields.
    """
    package, _, name = msgtype.rpartition('/')
    own = next(n for n in (msgtype, f'{package}/msg/{name}') if n in types)
    fields = {field_name for field_name, _ in types[own][1]}
    if '/srv/' in msgtype and not {'info', 'request', 'response'} <= fields:
        raise KeyError(msgtype)
    return own
