"""Why an endpoint gave no answer, as a value the retry and the reply can act on."""

from __future__ import annotations

from llm_astar_planner.waypoints.source import SourceStatus

MAX_DETAIL = 300


class EndpointFailure(Exception):  # noqa: N818 - a failure of the outside world, no bug
    """One request, or all its retries, brought no completion.

    `status` and `detail` go into the reply. `http` is the HTTP status, 0 where there was none;
    `body` the bounded error text. `retryable` says that the same request may work later, and
    `retry_after` in how many seconds, where the server said so. `is_ours` marks what the endpoint
    has no part in, such as a limit of ours.
    """

    def __init__(
        self,
        status: SourceStatus,
        detail: str,
        *,
        http: int = 0,
        body: str = '',
        retryable: bool = False,
        retry_after: float | None = None,
        is_ours: bool = False,
    ) -> None:
        """Keep the facts; `detail` is cut to MAX_DETAIL characters."""
        detail = ' '.join(detail.split())
        super().__init__(detail[:MAX_DETAIL])
        self.status = status
        self.detail = detail[:MAX_DETAIL]
        self.http = http
        self.body = body
        self.retryable = retryable
        self.retry_after = retry_after
        self.is_ours = is_ours
