"""Serves the page: the address, the socket, and a clean end."""

from __future__ import annotations

import contextlib
import errno
import socket
from types import FrameType

import uvicorn
from llm_astar_planner.parameter import ParameterError

from llm_astar_lab.play.app import PlayApp
from llm_astar_lab.play.guard import EVERY_ADDRESS

# Seconds that answers under way get at the end.
GRACE_S = 2
MAX_CONNECTIONS = 64


class PlayServer(uvicorn.Server):
    """A server that ends what its application does when it is told to end."""

    def __init__(self, app: PlayApp, host: str) -> None:
        """Serve an application at an address."""
        self._app = app
        super().__init__(
            uvicorn.Config(
                app.asgi(host),
                log_level='warning',
                access_log=False,
                server_header=False,
                limit_concurrency=MAX_CONNECTIONS,
                timeout_graceful_shutdown=GRACE_S,
            )
        )

    def handle_exit(self, sig: int, frame: FrameType | None) -> None:
        """End, after Ctrl-C or SIGTERM."""
        self._app.close()
        super().handle_exit(sig, frame)


def listen(host: str, port: int) -> socket.socket:
    """Return a socket that listens. Raises ParameterError, which names the fix."""
    if not 0 <= port <= 65535:
        raise ParameterError(f'--port {port}: is not in 0 to 65535')
    try:
        family, *_, address = socket.getaddrinfo(host, port, type=socket.SOCK_STREAM)[0]
        return socket.create_server((str(address[0]), port), family=family)
    except (OSError, UnicodeError) as error:
        number = error.errno if isinstance(error, OSError) else None
        if number == errno.EADDRINUSE:
            fix = 'is in use, perhaps by another `llm-astar play`; choose another, or 0 for any'
            raise ParameterError(f'--port {port}: {fix}') from None
        if number in (errno.EACCES, errno.EPERM):
            raise ParameterError(f'--port {port}: needs root; choose one above 1023') from None
        reason = getattr(error, 'strerror', None) or error
        message = f'--host {host}: {reason}; name an address of this machine, such as 127.0.0.1'
        raise ParameterError(message) from None


def url_of(host: str, port: int) -> str:
    """Return the address of the page for a browser on this machine."""
    name = 'localhost' if host in EVERY_ADDRESS else host
    return f'http://[{name}]:{port}/' if ':' in name else f'http://{name}:{port}/'


def serve(app: PlayApp, host: str, listener: socket.socket) -> None:
    """Serve an application at the socket of an address, until Ctrl-C or SIGTERM."""
    with contextlib.suppress(KeyboardInterrupt):  # which the server passes on after its end
        PlayServer(app, host).run(sockets=[listener])
