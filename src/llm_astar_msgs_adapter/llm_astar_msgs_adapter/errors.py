"""The base class of every error raised for bad input, bad files or a failed service."""


class LlmAstarError(Exception):
    """An error that a user can correct; the message names the file, the entry and the field.

    Subclasses are also ValueError, RuntimeError and so on, where callers expect those.
    """
