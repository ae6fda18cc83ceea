"""Serves the page: the address, the socket, who may ask, and a clean end.

Pages of its own may ask: browsers say in the headers of a request whose it is.
"""

from __future__ import annotations

import contextlib
import errno
import ipaddress
import re
import socket
from types import FrameType

import uvicorn
from llm_astar_planner.parameter import ParameterError
from starlette.datastructures import Headers, MutableHeaders
from starlette.types import ASGIApp, Message, Receive, Scope, Send

from llm_astar_lab.play.app import PlayApp, error_response

# Seconds that answers under way get at the end.
GRACE_S = 2
MAX_CONNECTIONS = 64
LOOPBACK = ('localhost', '127.0.0.1', '[::1]')
# Addresses that stand for every address of the machine.
EVERY_ADDRESS = ('0.0.0.0', '::')  # noqa: S104 - only compared with
HEADERS = {
    'content-security-policy': "default-src 'self'; img-src 'self' data: blob:; object-src "
    "'none'; base-uri 'none'; form-action 'none'; frame-ancestors 'none'",
    'x-content-type-options': 'nosniff',
    'referrer-policy': 'no-referrer',
    'cross-origin-resource-policy': 'same-origin',
    'cache-control': 'no-cache',
}
# The name or the address in a Host header, and its port.
HOST = re.compile(r'(\[[^\]]*\]|[^:]*)(:[0-9]+)?')


class Guard:
    """Answers requests of other sites with an error, and adds headers to every response.

    A page of another site can send requests to a server on loopback. Its name for the server
    (DNS rebinding) is in the Host header, itself in Origin, and without asking first it can only
    send forms, whose Content-Type is not JSON.
    """

    def __init__(self, app: ASGIApp, host: str = '127.0.0.1') -> None:
        """Guard an application that is served at an address."""
        self._app = app
        self._names = allowed_names(host)
        self._any_address = host in EVERY_ADDRESS

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Pass a request on, or refuse it."""
        if scope['type'] != 'http':
            await self._app(scope, receive, send)
            return

        async def send_guarded(message: Message) -> None:
            if message['type'] == 'http.response.start':
                headers = MutableHeaders(scope=message)
                for name, value in HEADERS.items():
                    headers.setdefault(name, value)
                if message['status'] >= 400:
                    # What is left of a body is not waited for.
                    headers['connection'] = 'close'
            await send(message)

        problem = self.problem(scope['method'], Headers(scope=scope))
        answer = self._app if problem is None else error_response(problem[1], '', problem[0])
        await answer(scope, receive, send_guarded)

    def problem(self, method: str, headers: Headers) -> tuple[int, str] | None:
        """Return with which status and sentence a request is refused, None if it is not."""
        host = headers.getlist('host')
        if len(host) != 1 or not self.knows(host[0]):
            return 421, (
                f'Host: {", ".join(host)[:80] or "none"} is not a name of this server; open it as '
                'localhost, or name the host with --host'
            )
        origin = headers.get('origin')
        if origin is not None and origin.lower() != f'http://{host[0].lower()}':
            return 403, f'Origin: {origin[:80]} is another site; open the page of this server'
        # Pictures and scripts are asked for without an Origin; a link may be followed.
        site, mode = headers.get('sec-fetch-site', 'none'), headers.get('sec-fetch-mode')
        if site not in ('none', 'same-origin') and mode != 'navigate':
            return 403, 'Sec-Fetch-Site: is another site; open the page of this server'
        kind = headers.get('content-type', '').partition(';')[0].strip().lower()
        if method not in ('GET', 'HEAD') and kind != 'application/json':
            return 415, 'Content-Type: is not application/json; send JSON'
        return None

    def knows(self, host: str) -> bool:
        """Tell whether a Host header names this server; the port does not matter."""
        match = HOST.fullmatch(host.strip().lower())
        name = match[1].rstrip('.') if match else ''
        return name in self._names or (self._any_address and is_address(name))


def allowed_names(host: str) -> frozenset[str]:
    """Return the names in Host headers by which a server at this address is reached."""
    names = {*LOOPBACK, host.lower(), f'[{host.lower()}]'}
    if host in EVERY_ADDRESS:
        names.add(socket.gethostname().lower())
    return frozenset(names)


def is_address(name: str) -> bool:
    """Tell whether a name is an IP address: no name server can make another site's of it."""
    try:
        ipaddress.ip_address(name.strip('[]'))
    except ValueError:
        return False
    return True


class PlayServer(uvicorn.Server):
    """A server that ends what its application does when it is told to end."""

    def __init__(self, app: PlayApp, host: str) -> None:
        """Serve an application at an address."""
        self._app = app
        super().__init__(
            uvicorn.Config(
                Guard(app.asgi(), host),
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
