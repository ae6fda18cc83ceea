"""Who may talk to the server: pages of its own, by the headers that browsers send."""

from __future__ import annotations

import ipaddress
import socket

from starlette.datastructures import Headers, MutableHeaders
from starlette.responses import JSONResponse
from starlette.types import ASGIApp, Message, Receive, Scope, Send

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
        if problem is None:
            await self._app(scope, receive, send_guarded)
            return
        status, sentence = problem
        refusal = JSONResponse({'error': sentence, 'field': ''}, status)
        await refusal(scope, receive, send_guarded)

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
        if method in ('GET', 'HEAD'):
            return None
        kind = headers.get('content-type', '').partition(';')[0].strip().lower()
        if kind != 'application/json':
            return 415, 'Content-Type: is not application/json; send JSON'
        return None

    def knows(self, host: str) -> bool:
        """Tell whether a Host header names this server; the port does not matter."""
        name = name_of(host)
        return name in self._names or (self._any_address and is_address(name))


def allowed_names(host: str) -> frozenset[str]:
    """Return the names in Host headers by which a server at this address is reached."""
    names = {*LOOPBACK, host.lower(), f'[{host.lower()}]'}
    if host in EVERY_ADDRESS:
        names.add(socket.gethostname().lower())
    return frozenset(names)


def name_of(host: str) -> str:
    """Return the name or the address in a Host header, without its port, '' for nonsense."""
    host = host.strip().lower()
    if host.startswith('['):
        name, bracket, port = host.partition(']')
        return name + bracket if not port or is_port(port) else ''
    name, colon, port = host.partition(':')
    return name.rstrip('.') if not colon or is_port(colon + port) else ''


def is_port(text: str) -> bool:
    """Tell whether a text is a colon and the digits of a port."""
    return text.startswith(':') and text[1:].isascii() and text[1:].isdigit()


def is_address(name: str) -> bool:
    """Tell whether a name is an IP address: no name server can make another site's of it."""
    try:
        ipaddress.ip_address(name.strip('[]'))
    except ValueError:
        return False
    return True
