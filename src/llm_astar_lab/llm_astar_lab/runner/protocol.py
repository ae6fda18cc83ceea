# Copyright 2026 The LLM-A* for ROS 2 contributors
# SPDX-License-Identifier: Apache-2.0

"""Pinned protocols: a user's file names the model; samples, prompts and seeds are the protocol's.

So the tables of two people are over the same samples, asked in the same words.
"""

from __future__ import annotations

import argparse
import hashlib
from collections import Counter
from collections.abc import Mapping
from importlib.resources import files
from typing import Any

from llm_astar_msgs_adapter.errors import LlmAstarError, printable, short_repr
from llm_astar_msgs_adapter.files import parse_yaml, read_yaml
from llm_astar_planner.waypoints.transcript import read_transcript

from llm_astar_lab.results.folder import ResultsFolder

PROTOCOLS = {
    path.name.removesuffix('.yaml'): path
    for path in files(__package__).joinpath('protocols').iterdir()
    if path.name.endswith('.yaml')
}
NEEDED = ('protocol', 'model', 'quantisation', 'server')
OPTIONAL = ('base_url', 'api_key_env', 'notes')
FIELDS = (*NEEDED, *OPTIONAL)
# What a file says of the endpoint, besides the model.
OF_ENDPOINT = ('base_url', 'api_key_env')
PROTOCOL_FILE = 'protocol.json'
MAX_CHARS = 2000


class ProtocolError(LlmAstarError, ValueError):
    """A file of --protocol cannot be used; the message names the file and the field."""


def apply_protocol(args: argparse.Namespace) -> dict[str, Any] | None:
    """Put a protocol's options, and the model of the user's file, in the place of the options.

    Return what the file says, with the protocol's own text digest; None without --protocol.
    Raises ProtocolError.
    """
    if args.protocol is None:
        return None
    card = read_card(args.protocol)
    text = PROTOCOLS[card['protocol']].read_bytes()
    pinned = parse_yaml(text.decode(), str(args.protocol), ProtocolError)
    own = {name: card[name] for name in OF_ENDPOINT if name in card}
    vars(args).update(pinned | own | {'source': ['endpoint'], 'model': [card['model']]})
    args.transcript, args.named, args.scales = [], None, '1'
    return card | {'sha256': hashlib.sha256(text).hexdigest(), 'pinned': pinned}


def read_card(path: str) -> dict[str, str]:
    """Return what a user's file says of the model. Raises ProtocolError."""
    found = read_yaml(path, ProtocolError)
    if not isinstance(found, Mapping):
        raise ProtocolError(f'{path}: fields are expected: {", ".join(NEEDED)}')
    for name in (*NEEDED, *found):
        value = found.get(name)
        if name not in FIELDS:
            shown = short_repr(str(name))
            raise ProtocolError(f'{path}: {shown}: is none of {", ".join(FIELDS)}')
        if not isinstance(value, str) or not 0 < len(value) <= MAX_CHARS:
            raise ProtocolError(f'{path}: {name}: a text to {MAX_CHARS} characters is expected')
    if found['protocol'] not in PROTOCOLS:
        known = ', '.join(sorted(PROTOCOLS))
        raise ProtocolError(
            f'{path}: protocol: {short_repr(found["protocol"])} is none of {known}'
        )
    return dict(found)


def sentence(card: Mapping[str, Any], samples: int) -> str:
    """Say which protocol and model a run is of, for its report."""
    said = {name: printable(card[name]) for name in NEEDED}
    return (
        f'protocol {said["protocol"]} ({card["sha256"][:12]}): {said["model"]}, '
        f'{said["quantisation"]}, on {said["server"]}; {samples} samples'
    )


def write_protocol(
    folder: ResultsFolder, card: Mapping[str, Any], metadata: Mapping[str, Any]
) -> None:
    """Write in one file what was asked of which model, with the digests. Raises ResultsError."""
    exchanges = read_transcript(folder.transcript) if folder.transcript.exists() else []
    made = [exchange.provenance for exchange in exchanges]
    folder.write_json(
        PROTOCOL_FILE,
        {
            **card,
            'version': metadata['version'],
            'dataset': metadata['dataset'],
            'files': metadata['files'],
            'statuses': dict(Counter(exchange.status.value for exchange in exchanges)),
            'model_digests': sorted({item.model_digest for item in made}),
            'prompt_digests': sorted({item.prompt_digest for item in made}),
            'temperatures': sorted({item.temperature for item in made} - {None}),
            'seeds': sorted({item.seed for item in made} - {None}),
        },
    )
