"""What a page is told when a request of its cannot be served."""

from __future__ import annotations

from llm_astar_msgs_adapter.errors import LlmAstarError


class PlayError(LlmAstarError, ValueError):
    """A request that cannot be served: one sentence with the fix, and the HTTP status.

    `field` names the field of the request, '' where none is at fault.
    """

    def __init__(self, message: str, field: str = '', status: int = 422) -> None:
        """Take the sentence, the field and the status."""
        super().__init__(message)
        self.field = field
        self.status = status
