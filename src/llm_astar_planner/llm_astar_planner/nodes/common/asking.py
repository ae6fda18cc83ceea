# Copyright 2026 The LLM-A* for ROS 2 contributors
# SPDX-License-Identifier: Apache-2.0

"""Calls services of other nodes, whose response may get lost."""

from __future__ import annotations

import threading
import time
from collections.abc import Mapping
from typing import Any

from rcl_interfaces.srv import SetParameters
from rclpy.client import Client
from rclpy.parameter import Parameter
from rclpy.task import Future

# Seconds without a response after which a service is asked again; twice as long each time.
ASK_AGAIN_S = 3.0


def ask(client: Client, request: Any, seconds: float, ask_again: float = ASK_AGAIN_S) -> Any:  # noqa: ANN401 - any service
    """Return the first response to a request, None if none comes within `seconds`.

    The request is sent again after `ask_again` seconds, so it must do no harm twice: a service
    that has not discovered its caller yet, while the caller has discovered it, drops the response.
    The caller's node has to be spun by somebody else.
    """
    deadline = time.monotonic() + seconds
    done = threading.Event()
    asked: list[Future] = []
    try:
        while not asked or time.monotonic() < deadline:
            asked.append(client.call_async(request))
            asked[-1].add_done_callback(lambda _: done.set())
            if done.wait(max(0.0, min(ask_again, deadline - time.monotonic()))):
                return next(future for future in asked if future.done()).result()
            ask_again *= 2.0
        return None
    finally:
        for future in asked:
            client.remove_pending_request(future)


def setting(values: Mapping[str, Any]) -> SetParameters.Request:
    """Return the request that sets parameters."""
    parameters = [Parameter(name, value=value) for name, value in values.items()]
    return SetParameters.Request(parameters=[one.to_parameter_msg() for one in parameters])
