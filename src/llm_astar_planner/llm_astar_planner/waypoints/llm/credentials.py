"""The endpoint of requests, its key, and how the key is kept out of texts.

The key is read from the environment when a request is made, and is not stored.
"""

from __future__ import annotations

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
_VARIABLE = re.compile(r'[A-Z_][A-Z0-9_]{0,63}')
OPENAI_HOST = 'api.openai.com'
MASK = '***'
# A shorter key protects nothing, and masking it would damage ordinary words.
MIN_SECRET = 6


class EndpointError(LlmAstarError, ValueError):
    """An endpoint's URL, or the name of its key's variable, cannot be used."""


@dataclass(frozen=True)
class Endpoint:
    """An OpenAI-compatible server: its base URL, and the NAME of the variable with its key.

    An empty name means OPENAI_API_KEY at OpenAI itself and no key elsewhere.
    Raises EndpointError for a URL that is not plain http(s)://host[:port][/path].
    """

    base_url: str
    api_key_env: str = ''

    def __post_init__(self) -> None:
        """Check both; messages do not repeat the values, which may be secret."""
        if self.api_key_env and not _VARIABLE.fullmatch(self.api_key_env):
            # The value may be a pasted key.
            raise EndpointError('api_key_env: the NAME of a variable, in capitals, is expected')
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

    @property
    def url(self) -> str:
        """The address that requests are posted to."""
        return self.base_url.rstrip('/') + '/chat/completions'

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


def redact(text: str, secret: str) -> str:
    """Return `text` with the secret masked."""
    return text.replace(secret, MASK) if len(secret) >= MIN_SECRET else text


def redact_bytes(data: bytes, secret: str) -> bytes:
    """Return `data` with the secret masked; call it before cutting, which could halve the key."""
    return data.replace(secret.encode(), MASK.encode()) if len(secret) >= MIN_SECRET else data
