"""The base of every error raised for bad input, bad files or a failed outside world."""


class LlmAstarError(Exception):
    """Something a user can put right; the message names the file, the field and the fix.

    Subclasses are also ValueError, RuntimeError and so on, where callers expect those.
    """
