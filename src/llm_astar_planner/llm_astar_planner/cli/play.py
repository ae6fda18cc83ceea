"""Plan in the browser: drag start and goal, draw walls, and watch the search.

A small server on this machine shows the page; nothing is sent anywhere else.
"""

from __future__ import annotations

import argparse
import contextlib
import errno
import socket
import sys
import threading
import webbrowser
from typing import TYPE_CHECKING

from llm_astar_planner.parameter import ParameterError

if TYPE_CHECKING:
    from starlette.applications import Starlette

DEFAULT_HOST, DEFAULT_PORT = '127.0.0.1', 8321
# Seconds that answers under way get at the end.
GRACE_S = 1
MAX_CONNECTIONS = 64

EPILOG = """\
examples:
  llm-astar play
  llm-astar play --map depot.yaml --map maze.map.scen
  llm-astar play --port 9000 --no-browser

The page shows how a search expands the map cell by cell, what became of each waypoint, and the
figures beside those without waypoints and of A*. Its address holds the whole view, so a link shows
it again, and it gives the `llm-astar plan` command that makes the same plan.

Ctrl-C ends the server. Only this machine reaches it; --host 0.0.0.0 opens it to the network, whose
members may then plan on the listed maps, but read no other file.
"""


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the options."""
    parser.add_argument(
        '--map',
        action='append',
        default=[],
        metavar='FILE',
        help='a map to offer besides the shipped ones: map_server yaml, MovingAI x.map or '
        'x.map.scen, or barrier-map JSON; repeat it for more',
    )
    parser.add_argument(
        '--host', default=DEFAULT_HOST, help='address to serve at (default: %(default)s)'
    )
    parser.add_argument(
        '--port',
        type=int,
        default=DEFAULT_PORT,
        help='port to serve at; 0 takes a free one (default: %(default)s)',
    )
    parser.add_argument('--no-browser', action='store_true', help='do not open the browser')


def run(arguments: argparse.Namespace) -> int:
    """Serve until Ctrl-C; return 0, or 1 where a library is missing.

    Raises ParameterError where it cannot serve at the address, and what reading maps raises.
    """
    # Optional dependencies; the help needs to work without them.
    try:
        import starlette  # noqa: F401, PLC0415
        import uvicorn  # noqa: F401, PLC0415
    except ImportError as error:
        sys.stderr.write(
            f"llm-astar: error: {error.name} is missing: pip install 'starlette' 'uvicorn'\n"
        )
        return 1
    from llm_astar_planner.play.app import PlayApp  # noqa: PLC0415
    from llm_astar_planner.play.maps import Maps  # noqa: PLC0415

    with listen(arguments.host, arguments.port) as listener:
        app = PlayApp(Maps(arguments.map))
        url = url_of(arguments.host, listener.getsockname()[1])
        print(f'the page is at {url} (Ctrl-C ends it)', flush=True)
        if not arguments.no_browser:
            threading.Thread(target=webbrowser.open, args=(url,), daemon=True).start()
        serve(app.asgi(arguments.host), listener)
    return 0


def listen(host: str, port: int) -> socket.socket:
    """Return a socket that listens. Raises ParameterError, which names the fix."""
    if not 0 <= port <= 65535:
        raise ParameterError(f'--port {port}: is not in 0 to 65535')
    try:
        family, *_, address = socket.getaddrinfo(host, port, type=socket.SOCK_STREAM)[0]
        return socket.create_server(address[:2], family=family)
    except (OSError, UnicodeError) as error:
        number = getattr(error, 'errno', None)
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
    if host in ('0.0.0.0', '::'):  # noqa: S104 - only compared with
        host = 'localhost'
    return f'http://[{host}]:{port}/' if ':' in host else f'http://{host}:{port}/'


def serve(app: Starlette, listener: socket.socket) -> None:
    """Serve an application until Ctrl-C or SIGTERM."""
    import uvicorn  # noqa: PLC0415 - see run

    config = uvicorn.Config(
        app,
        log_level='warning',
        access_log=False,
        server_header=False,
        limit_concurrency=MAX_CONNECTIONS,
        timeout_graceful_shutdown=GRACE_S,
    )
    with contextlib.suppress(KeyboardInterrupt):  # which the server passes on after its end
        uvicorn.Server(config).run(sockets=[listener])
    print('stopped')
