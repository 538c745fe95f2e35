"""The gate of a page: the token of its address, and the name under which it is asked for."""

from __future__ import annotations

import hmac
from collections.abc import Awaitable, Callable, Iterable, MutableMapping
from typing import Any

Message = MutableMapping[str, Any]
Receive = Callable[[], Awaitable[Message]]
Send = Callable[[Message], Awaitable[None]]
App = Callable[[Message, Receive, Send], Awaitable[None]]

HOSTS = ("127.0.0.1", "localhost")
"""Names of this machine by which a browser may ask; another one is DNS that was turned to it."""
KEPT_TO_ITSELF = (
    (b"referrer-policy", b"no-referrer"),
    (b"x-content-type-options", b"nosniff"),
    (b"x-frame-options", b"DENY"),
    (b"cache-control", b"no-store"),
    (
        b"content-security-policy",
        b"default-src 'self' data: blob: 'unsafe-inline' 'unsafe-eval'; connect-src 'self';"
        b" frame-ancestors 'none'; form-action 'none'; base-uri 'self'",
    ),
)
"""Headers of every answer: no address with a token leaves, nothing is loaded from elsewhere."""
LOST = b"404: nothing is here. The address that the command printed has a token."


class Gate:
    """An ASGI application that lets through what asks for `/TOKEN/...` under a name of this
    machine, from a page of its own; anything else gets 404, a websocket is refused.

    Parameters
    ----------
    app
        What is behind it, mounted at `/TOKEN`.
    token : str
        First part of every path.
    port : int
        Of the server.
    """

    def __init__(self, app: App, token: str, port: int):
        self.app, self._token = app, token.encode()
        self._hosts = {f"{host}:{port}".encode() for host in HOSTS}
        self._origins = {b"http://" + host for host in self._hosts}

    async def __call__(self, scope: Message, receive: Receive, send: Send) -> None:
        """Answer one connection."""
        if scope["type"] == "lifespan":
            await self.app(scope, receive, send)
        elif self.admits(scope["path"], scope["headers"]):
            await self.app(scope, receive, _closed(send))
        elif scope["type"] == "websocket":
            await receive()
            await send({"type": "websocket.close", "code": 1008})
        else:
            headers = [(b"content-type", b"text/plain"), *KEPT_TO_ITSELF]
            await send({"type": "http.response.start", "status": 404, "headers": headers})
            await send({"type": "http.response.body", "body": LOST})

    def admits(self, path: str, headers: Iterable[tuple[bytes, bytes]]) -> bool:
        """Whether a path has the token, and all of Host and Origin are this machine."""
        first = path.encode().split(b"/")[1:2]
        known = bool(first) and hmac.compare_digest(first[0], self._token)
        headers = list(headers)
        hosts = [value for name, value in headers if name == b"host"]
        origins = [value for name, value in headers if name == b"origin"]
        return (
            known
            and hosts != []
            and self._hosts.issuperset(hosts)
            and (self._origins.issuperset(origins))
        )


def _closed(send: Send) -> Send:
    """Return a `send` that adds the headers `KEPT_TO_ITSELF`."""
    own = {name for name, _ in KEPT_TO_ITSELF}

    async def sent(message: Message) -> None:
        if message["type"] == "http.response.start":
            headers = [pair for pair in message.get("headers", ()) if pair[0].lower() not in own]
            message = {**message, "headers": [*headers, *KEPT_TO_ITSELF]}
        await send(message)

    return sent
