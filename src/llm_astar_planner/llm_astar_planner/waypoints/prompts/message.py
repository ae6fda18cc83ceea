"""One message of a chat."""

from typing import NamedTuple


class Message(NamedTuple):
    """Who speaks (`system`, `user` or `assistant`) and what is said."""

    role: str
    content: str
