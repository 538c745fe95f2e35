"""A page of NiceGUI in a thread of its own, on this machine alone, behind a token."""

from __future__ import annotations

import asyncio
import secrets
import socket
import threading
from collections.abc import Callable
from typing import Any

from studies.page.gate import Gate
from symheli.errors import InputError
from symheli.extras import extra

HOST = "127.0.0.1"
PORT = 8400
"""Port of a page, where none is given; the next free one where it is taken."""
TRIED = 20
"""Ports that are tried from there."""
SOON = 1.5
"""Seconds that open connections have when the page is closed."""
ICON = "data:image/svg+xml,<svg xmlns='http://www.w3.org/2000/svg'/>"


class PageServer:
    """A page under a random address, until `close`: in a thread, so that the main one can work.

    Parameters
    ----------
    build : callable
        Fills the page for each browser that opens it; called in the thread of the server.
    title : str
        Of the window.
    port : int
        0 to take `PORT` or the next free one.

    Raises
    ------
    InputError
        A port that is taken, the extra `live` missing, a second page in one process.
    """

    def __init__(self, build: Callable[[], None], title: str, port: int = 0):
        self._socket = bound(port)
        self.port = self._socket.getsockname()[1]
        self.token = secrets.token_urlsafe(24)
        try:
            self._server = _server(build, title, self.token, self.port)
        except BaseException:
            self._socket.close()
            raise
        self._thread = threading.Thread(target=self._serve, daemon=True, name="page")
        self._thread.start()

    @property
    def address(self) -> str:
        """Address to open in a browser."""
        return f"http://{HOST}:{self.port}/{self.token}/"

    def _serve(self) -> None:
        asyncio.run(self._server.serve(sockets=[self._socket]))

    def close(self) -> None:
        """End the page, within two seconds even where a browser holds on."""
        self._server.should_exit = True
        self._thread.join(SOON)
        self._server.force_exit = True
        self._socket.close()


def bound(port: int) -> socket.socket:
    """Return a socket that listens at a port of this machine; 0: `PORT` or the next free one.

    Raises `InputError` where it is taken.
    """
    wanted = (port,) if port else range(PORT, PORT + TRIED)
    for one in wanted:
        made = socket.socket(socket.AF_INET, socket.SOCK_STREAM)
        made.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
        try:
            made.bind((HOST, one))
            made.listen(64)
        except (OSError, OverflowError):
            made.close()
        else:
            return made
    raise InputError(f"--page: port {wanted[0]} of {HOST} cannot be had: give another")


def _server(build: Callable[[], None], title: str, token: str, port: int) -> Any:
    """Return the server of uvicorn that is about to run."""
    with extra("live", "a page in the browser"):
        import fastapi
        import nicegui
        import uvicorn
    if nicegui.app.config.has_run_config:
        raise InputError("a page is open in this process: close the process, or keep that page")

    @nicegui.ui.page("/")
    def page() -> None:
        build()

    outer = fastapi.FastAPI(docs_url=None, redoc_url=None, openapi_url=None)
    nicegui.ui.run_with(
        outer,
        title=title,
        dark=None,
        favicon=ICON,
        mount_path=f"/{token}",
        tailwind=False,
        show_welcome_message=False,
        storage_secret=None,
    )
    config = uvicorn.Config(
        Gate(outer, token, port),
        log_level="error",
        access_log=False,
        server_header=False,
        timeout_graceful_shutdown=1,
        ws="auto",
    )
    return uvicorn.Server(config)
