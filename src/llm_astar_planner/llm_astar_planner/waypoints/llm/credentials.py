# Copyright 2026 The LLM-A* for ROS 2 contributors
# SPDX-License-Identifier: Apache-2.0

"""The endpoint of requests, its key, and what keeps the key out of texts that a server wrote.

The key is read from the environment when a request is made, and is not stored. A server may echo
the request, with its key, in an error or an answer: as it is, escaped for JSON, HTML or a URL, in
base64, or broken over lines. Nothing can be done about a server that encrypts it; but that one
has the key anyway.
"""

import base64
import fnmatch
import html
import ipaddress
import os
import re
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from urllib.parse import unquote, urlsplit

from llm_astar_msgs_adapter.errors import LlmAstarError
from llm_astar_msgs_adapter.files import read_yaml

from llm_astar_planner.waypoints.llm.resilience import EndpointFailure
from llm_astar_planner.waypoints.source import KEY_NAMES, SourceStatus

_VARIABLE = re.compile('[A-Z_][A-Z0-9_]{0,63}')
_PATTERN = re.compile(r'[A-Z_*][A-Z0-9_*]{0,63}')
OPENAI_HOST = 'api.openai.com'
MASK = '***'
WITHHELD = '(withheld, since it repeats the key)'
# A shorter key protects nothing, and masking it would damage ordinary words.
MIN_SECRET = 6
# So many characters of a key in a row are a leak. Services quote fewer, so that a user knows which
# key is meant. Base64 takes four characters for three.
LEAK, LEAK_BASE64 = 12, 16
# Escapes within escapes, at most; what has more is withheld.
MAX_DEPTH = 5
# What may stand within an escape: blanks, letters of no width, the colours of a terminal.
_NOT_SEEN = re.compile(r'\x1b\[[0-9;]*[a-zA-Z]|[^!-~]+')
_ESCAPE = re.compile(
    r'\\U([0-9a-fA-F]{8})|[\\%][uU]([0-9a-fA-F]{4})|\\(?:[uU]\{([0-9a-fA-F]{1,6})\}'
    r'|[xX]([0-9a-fA-F]{2})|([0-7]{3})|[bfnrtv]|(.))'
)
_NO_LETTER = re.compile('[^0-9a-z]+')


class EndpointError(LlmAstarError, ValueError):
    """An endpoint's URL, or the name of its key's variable, cannot be used."""


# Well-known variables of services: each key is sent to its own host only.
KEY_HOSTS = read_yaml(Path(__file__).with_name('key_hosts.yaml'), EndpointError)


@dataclass(frozen=True)
class Endpoint:
    """An OpenAI-compatible server: its base URL, and the NAME of the variable with its key.

    An empty name means OPENAI_API_KEY at OpenAI itself and no key elsewhere. Others must match one
    of `api_key_names`, patterns separated by commas, so that no other variable is ever sent.
    Raises EndpointError for a URL that is not plain http(s)://host[:port][/path].
    """

    base_url: str
    api_key_env: str = ''
    api_key_names: str = KEY_NAMES

    def __post_init__(self) -> None:
        """Check all; messages do not repeat the values, which may be secret."""
        if self.api_key_env and not _VARIABLE.fullmatch(self.api_key_env):
            # The value may be a pasted key.
            raise EndpointError('api_key_env: the NAME of a variable, in capitals, is expected')
        patterns = key_patterns(self.api_key_names)
        is_known = any(fnmatch.fnmatchcase(self.api_key_env, pattern) for pattern in patterns)
        if self.api_key_env and not is_known:
            known = ' or '.join(patterns) or 'none'
            problem = f'the name must match {known}; to allow others, start with api_key_names'
            raise EndpointError(f'api_key_env: {problem}')
        parts = urlsplit(self.base_url)
        try:
            whole = parts.scheme in ('http', 'https') and parts.hostname and parts.port != 0
        except ValueError:
            whole = False
        if not whole:
            raise EndpointError('base_url: http://host[:port]/path or https://... is expected')
        if parts.username is not None or parts.query or parts.fragment:
            words = 'must not hold a user, query or fragment; api_key_env names the key'
            raise EndpointError(f'base_url: {words}')

    def url(self, path: str) -> str:
        """Return the address of a path below the base URL."""
        return f'{self.base_url.rstrip("/")}/{path}'

    @property
    def host(self) -> str:
        """The host in lower case."""
        return (urlsplit(self.base_url).hostname or '').lower()

    @property
    def is_loopback(self) -> bool:
        """Whether the host is this machine: it needs no key and is reached without a proxy."""
        if self.host == 'localhost' or self.host.endswith('.localhost'):
            return True
        try:
            return ipaddress.ip_address(self.host).is_loopback
        except ValueError:
            return False

    def key(self) -> str:
        """Read the key from the environment; '' where none is sent.

        Raises EndpointFailure NOT_CONFIGURED where a key is needed and missing, or belongs to
        another host.
        """
        name = self.api_key_env or ('OPENAI_API_KEY' if self.host == OPENAI_HOST else '')
        if not name:
            if self.is_loopback:
                return ''
            raise not_configured(f'no key for {self.host}: set api_key_env to the NAME of the '
                                  'environment variable that holds it')  # fmt: skip
        owner = KEY_HOSTS.get(name)
        if owner and owner != self.host:
            raise not_configured(f'{name} is the key of {owner} and is not sent to {self.host}; '
                                  'name another variable in api_key_env')  # fmt: skip
        if not self.is_loopback and not self.base_url.lower().startswith('https:'):
            raise not_configured(f'{name} is only sent over https, or to this machine')
        key = os.environ.get(name, '').strip()
        if not key:
            raise not_configured(f'the environment variable {name} is not set')
        if not (key.isascii() and key.isprintable()) or ' ' in key:
            raise not_configured(f'the environment variable {name} holds no usable key')
        return key


def not_configured(detail: str) -> EndpointFailure:
    """Return the failure of an endpoint whose key cannot be used."""
    return EndpointFailure(SourceStatus.NOT_CONFIGURED, detail)


def key_patterns(names: str) -> list[str]:
    """Split `api_key_names`. Raises EndpointError for what is no pattern of a variable's name."""
    patterns = [name.strip() for name in names.split(',') if name.strip()]
    if not all(map(_PATTERN.fullmatch, patterns)):
        words = 'names of variables, in capitals, with * for any part, separated by commas'
        raise EndpointError(f'api_key_names: {words}, are expected')
    return patterns


def redact(text: str, secret: str) -> str:
    """Return `text` without the secret: masked, or all withheld where it is spelt otherwise."""
    if len(secret) < MIN_SECRET:
        return text
    text = text.replace(secret, MASK)
    return WITHHELD if repeats(text, secret) else text


def repeats(text: str, secret: str) -> bool:
    """Return whether a text holds a secret, or LEAK characters of it in a row, in any spelling.

    Only letters and digits are compared, without their case, so it does not matter what stands
    between them. Linear in the length of the text.
    """
    parts = spellings(secret)
    for _ in range(MAX_DEPTH):
        text = _NOT_SEEN.sub('', text)
        letters = _NO_LETTER.sub('', text.lower())
        if secret in text or any(part in letters for part in parts):
            return True
        before, text = text, unescape(text)
        if text == before:
            return False
    return True


def spellings(secret: str) -> set[str]:
    """Return the texts of lower-case letters and digits of which none may appear."""
    # An escape that is part of the key is decoded with the others.
    found = {*windows(secret, LEAK), *windows(unescape(secret), LEAK)}
    # What stands before it decides how the bytes fall into groups of three. The first and the last
    # characters depend on the neighbours.
    for before in range(3):
        coded = base64.b64encode(bytes(before) + secret.encode()).decode().rstrip('=')
        found.update(windows(coded[before + 1 if before else 0 : -1], LEAK_BASE64))
    return found


def windows(text: str, length: int) -> Iterator[str]:
    """Return all parts of so many letters and digits, or the one whole that is shorter."""
    letters = _NO_LETTER.sub('', text.lower())
    if len(letters) >= MIN_SECRET:
        for start in range(max(1, len(letters) - length + 1)):
            yield letters[start : start + length]


def unescape(text: str) -> str:
    """Undo one level of escapes: of JSON, URLs and HTML."""
    return html.unescape(unquote(_ESCAPE.sub(unescaped, text)))


def unescaped(found: re.Match[str]) -> str:
    """Return the character that an escape with a backslash stands for."""
    *numbers, octal, letter = found.groups()
    code = int(next(filter(None, numbers), '0'), 16) or int(octal or '0', 8)
    return chr(code) if 0 < code < 0x110000 else letter or ''
