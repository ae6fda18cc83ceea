"""The endpoint of requests, and its key.

The key is read from the environment when a request is made, and is not stored.
"""

from __future__ import annotations

import fnmatch
import ipaddress
import os
import re
from dataclasses import dataclass
from urllib.parse import urlsplit

from llm_astar_msgs_adapter.errors import LlmAstarError

from llm_astar_planner.waypoints.llm.resilience import EndpointFailure
from llm_astar_planner.waypoints.source import SourceStatus

# Well-known variables of services: each key is sent to its own host only.
KEY_HOSTS = {
    'OPENAI_API_KEY': 'api.openai.com',
    'ANTHROPIC_API_KEY': 'api.anthropic.com',
    'OPENROUTER_API_KEY': 'openrouter.ai',
    'GROQ_API_KEY': 'api.groq.com',
    'MISTRAL_API_KEY': 'api.mistral.ai',
    'DEEPSEEK_API_KEY': 'api.deepseek.com',
    'TOGETHER_API_KEY': 'api.together.xyz',
    'GEMINI_API_KEY': 'generativelanguage.googleapis.com',
    'GOOGLE_API_KEY': 'generativelanguage.googleapis.com',
    'XAI_API_KEY': 'api.x.ai',
}
_VARIABLE = re.compile('[A-Z_][A-Z0-9_]{0,63}')
_PATTERN = re.compile(r'[A-Z_*][A-Z0-9_*]{0,63}')
# Which variables may hold a key, unless the start says otherwise.
KEY_NAMES = '*_API_KEY, *_TOKEN'
OPENAI_HOST = 'api.openai.com'


class EndpointError(LlmAstarError, ValueError):
    """An endpoint's URL, or the name of its key's variable, cannot be used."""


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
        if self.api_key_env and not any(
            fnmatch.fnmatchcase(self.api_key_env, pattern) for pattern in patterns
        ):
            raise EndpointError(
                f'api_key_env: the name must match {" or ".join(patterns) or "none"}; to allow '
                'others, start with api_key_names'
            )
        parts = urlsplit(self.base_url)
        try:
            whole = parts.scheme in ('http', 'https') and parts.hostname and parts.port != 0
        except ValueError:
            whole = False
        if not whole:
            raise EndpointError('base_url: http://host[:port]/path or https://... is expected')
        if parts.username is not None or parts.query or parts.fragment:
            raise EndpointError(
                'base_url: must not hold a user, query or fragment; api_key_env names the key'
            )

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
        raise EndpointError(
            'api_key_names: names of variables, in capitals, with * for any part, separated by '
            'commas, are expected'
        )
    return patterns
