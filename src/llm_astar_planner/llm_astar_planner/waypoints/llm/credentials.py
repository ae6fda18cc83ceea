"""Where requests go and with which key: the key is read when a request is made, never kept."""

from __future__ import annotations

import ipaddress
import os
import re
from dataclasses import dataclass
from urllib.parse import urlsplit

from llm_astar_planner.waypoints.llm.failure import EndpointFailure
from llm_astar_planner.waypoints.source import SourceStatus

# Keys that services tell everyone to export: each goes to its own host and nowhere else.
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
_NAME = re.compile(r'[A-Z_][A-Z0-9_]{0,63}')
OPENAI_HOST = 'api.openai.com'


@dataclass(frozen=True)
class Endpoint:
    """An OpenAI-compatible server: its base URL, and the NAME of the variable with its key.

    An empty name means OPENAI_API_KEY at OpenAI itself and no key elsewhere.
    Raises ValueError for a URL that is not plain http(s)://host[:port][/path].
    """

    base_url: str
    api_key_env: str = ''

    def __post_init__(self) -> None:
        """Check both; what they say is not repeated, since it may be a secret."""
        if self.api_key_env and not _NAME.fullmatch(self.api_key_env):
            # Somebody may have pasted the key itself.
            raise ValueError('api_key_env: the NAME of a variable, in capitals, is expected')
        parts = urlsplit(self.base_url)
        try:
            whole = parts.scheme in ('http', 'https') and parts.hostname and parts.port != 0
        except ValueError:
            whole = False
        if not whole:
            raise ValueError('base_url: http://host[:port]/path or https://... is expected')
        if parts.username is not None or parts.query or parts.fragment:
            raise ValueError(
                'base_url: holds a user, a query or a fragment; keys go by api_key_env'
            )

    @property
    def url(self) -> str:
        """The address of the one dialect spoken."""
        return self.base_url.rstrip('/') + '/chat/completions'

    @property
    def host(self) -> str:
        """The host in lower case."""
        return (urlsplit(self.base_url).hostname or '').lower()

    @property
    def is_loopback(self) -> bool:
        """Whether it is this machine: no key is needed and no proxy asked."""
        if self.host == 'localhost' or self.host.endswith('.localhost'):
            return True
        try:
            return ipaddress.ip_address(self.host).is_loopback
        except ValueError:
            return False

    def key(self) -> str:
        """Read the key from the environment; '' where none is sent.

        Raises EndpointFailure NOT_CONFIGURED where one is needed and missing, or is another's.
        """
        name = self.api_key_env or ('OPENAI_API_KEY' if self.host == OPENAI_HOST else '')
        if not name:
            if self.is_loopback:
                return ''
            raise _not_configured(f'no key for {self.host}: set api_key_env to the NAME of the '
                                  'environment variable that holds it')  # fmt: skip
        owner = KEY_HOSTS.get(name)
        if owner and owner != self.host:
            raise _not_configured(f'{name} is the key of {owner} and is not sent to {self.host}; '
                                  'name another variable in api_key_env')  # fmt: skip
        if owner and not self.base_url.lower().startswith('https:'):
            raise _not_configured(f'{name} is only sent over https')
        key = os.environ.get(name, '').strip()
        if not key:
            raise _not_configured(f'the environment variable {name} is not set')
        if not (key.isascii() and key.isprintable()) or ' ' in key:
            raise _not_configured(f'the environment variable {name} holds no usable key')
        return key


def _not_configured(detail: str) -> EndpointFailure:
    return EndpointFailure(SourceStatus.NOT_CONFIGURED, detail)
