"""Serves the page, and holds the WebSockets of all pages and of their pictures.

A thread of its own with an event loop; the service's thread takes what has arrived and hands over
what is to be shown. Nothing waits for a page: one that has not read its last picture is left
out."""

import asyncio
import logging
import socket
import ssl
import threading
import time
from collections import deque
from collections.abc import AsyncIterator, Callable, Mapping, Sequence
from functools import partial
from pathlib import Path
from typing import Any, TypeVar, cast
from urllib.parse import parse_qs

from websockets.asyncio.server import ServerConnection, broadcast, serve
from websockets.exceptions import ConnectionClosed
from websockets.http11 import Request, Response

from messages import events
from messages.cameras import FIRST
from messages.events import Outbox
from services.cockpit.core import Settings
from services.cockpit.handshake import SOCKETS, VIDEO, WATCH, Access
from services.cockpit.io.access import listening
from services.cockpit.io.files import PageFiles, plain
from services.cockpit.page_messages import (
    LONGEST,
    PageClosed,
    PageEvent,
    PageOpened,
    PageSaid,
    PageSticks,
    parsed,
)
from services.cockpit.video import PageUnit, PageVideo, RecentUnits
from services.runtime.config.errors import LindyError

T = TypeVar("T")
MOST_PER_SECOND = 250  # [1/s] a page sends 50 to 125 sticks, 25 confirmations, and one per picture
LONGEST_CONFIRMATION = 10  # [B] a number
MOST_PAGES = 32
MOST_WATCHERS = 24  # of them: the others' places are for pilots
MOST_CONNECTIONS = 192  # with those for pictures and files, and those that say nothing
WAITING = 64  # events of all pages that may wait for the service
HANDSHAKE_S = 5.0  # [s] for a connection to say what it wants
SEND_BUFFER = 32_768  # [B] of the system, per page: some pictures
TOO_BIG, TOO_FAST = 1009, 1008  # close codes of the protocol
OLD_PAGE, TOO_MANY = 4001, 4002  # and our own


async def said(connection: ServerConnection, outbox: Outbox) -> AsyncIterator[str | bytes]:
    """What a page says, until it says too much within a second."""
    second = heard = 0
    async for raw in connection:
        now = int(time.monotonic())
        second, heard = now, heard + 1 if now == second else 1
        if heard > MOST_PER_SECOND:
            outbox.tell(events.TOO_MANY_PAGE_MESSAGES())
            await connection.close(TOO_FAST, "too many messages")
            return
        yield raw


class VideoServer:
    def __init__(self, outbox: Outbox) -> None:
        self._outbox = outbox
        self._pages: dict[ServerConnection, PageVideo] = {}
        self._recent = RecentUnits()

    def send(self, unit: PageUnit) -> None:
        """To every page that can do with it."""
        self._recent.add(unit)
        now = time.monotonic_ns()
        taking = [page for page, video in self._pages.items() if video.admits(unit, now)]
        self._outbox.tell(events.DROPPED_PAGE_VIDEO(), len(self._pages) - len(taking))
        broadcast(taking, unit.message)

    async def page(self, connection: ServerConnection) -> None:
        """One page, until it is closed."""
        video = PageVideo()
        now = time.monotonic_ns()
        for unit in self._recent:
            if video.admits(unit, now):
                broadcast([connection], unit.message)
        self._pages[connection] = video
        try:
            async for raw in said(connection, self._outbox):
                is_number = len(raw) <= LONGEST_CONFIRMATION and raw.isascii() and raw.isdigit()
                if not (is_number and video.confirmed(int(raw))):
                    self._outbox.tell(events.MALFORMED_PAGE())
        except ConnectionClosed:
            pass
        finally:
            del self._pages[connection]


class PageServer:
    def __init__(
        self,
        settings: Settings,
        access: Access,
        outbox: Outbox,
        cameras: Sequence[str] = (FIRST,),
    ) -> None:
        """Listen.

        Args:
            cameras: names of the drone's; the first one first.

        Raises:
            LindyError: the address cannot be used, or the certificate is no good.
        """
        self._outbox = outbox
        self._access, self._files = access, PageFiles()
        self._events: deque[PageEvent] = deque()
        self._lock = threading.Lock()  # of the events
        self._pages: dict[int, ServerConnection] = {}
        self._watchers: set[int] = set()
        self._video = {camera: VideoServer(outbox) for camera in cameras}
        self._last = 0  # number of the newest page
        self.connections = 0  # that are open
        self._notify: Callable[[], None] = lambda: None
        self._tls = _tls(settings)
        self._socket = listening(settings)
        self._loop = asyncio.new_event_loop()
        self._thread: threading.Thread | None = None

    def start(self, notify: Callable[[], None]) -> None:
        """Begin to serve; `notify` is called when something has arrived."""
        self._notify = notify
        self._thread = threading.Thread(target=self._run, daemon=True)
        self._thread.start()

    def close(self) -> None:
        if self._thread is None:
            self._socket.close()
            self._loop.close()
            return
        self._loop.call_soon_threadsafe(self._stop.set)
        self._thread.join(2.0)

    def received(self) -> list[PageEvent]:
        """Everything that has arrived since, in order; of sticks the newest only."""
        with self._lock:
            heard, self._events = self._events, deque()
        return list(heard)

    def show(self, texts: Mapping[int, str]) -> None:
        """Send each page its picture, unless the last one has not left yet."""
        if texts:
            self._soon(self._send, texts)

    def show_video(self, unit: PageUnit, camera: str = FIRST) -> None:
        """Send every page a picture of a camera."""
        self._soon(self._video[camera].send, unit)

    def _soon(self, act: Callable[[T], None], what: T) -> None:
        if self._thread is not None and not self._loop.is_closed():
            self._loop.call_soon_threadsafe(act, what)

    # On the thread of its own.

    def _run(self) -> None:
        asyncio.set_event_loop(self._loop)
        self._stop = asyncio.Event()
        try:
            self._loop.run_until_complete(self._serve())
        finally:
            self._loop.close()

    async def _serve(self) -> None:
        quiet = logging.getLogger("lindy.cockpit")  # what strangers send is counted, not logged
        quiet.disabled = True
        server = serve(
            self._page,
            sock=self._socket,
            ssl=self._tls,
            process_request=self._answer,
            # A class, says its type; it is called only.
            create_connection=cast(Any, partial(CountedConnection, self)),
            compression=None,
            max_size=LONGEST,
            max_queue=8,
            open_timeout=HANDSHAKE_S,
            close_timeout=0.5,
            ping_interval=5.0,
            ping_timeout=5.0,
            server_header=None,
            logger=quiet,
        )
        async with server:
            await self._stop.wait()

    def _answer(self, connection: ServerConnection, request: Request) -> Response | None:
        """A file, a refusal, or None: the WebSocket is opened."""
        del connection
        headers = request.headers
        path = request.path.partition("?")[0]
        why = self._access.refusal(request.path, headers.get_all("Host"), headers.get_all("Origin"))
        if why:
            self._outbox.tell(events.REFUSED_PAGE())
            return plain(403, "Forbidden", why)
        # No other path ever becomes a WebSocket: only these three were checked above.
        if path in SOCKETS:
            return None
        return self._files.response(path, ", ".join(headers.get_all("Accept-Encoding")))

    async def _page(self, connection: ServerConnection) -> None:
        """One page, until it is closed."""
        request = connection.request
        assert request is not None
        path, _, query = request.path.partition("?")
        asked = parse_qs(query)
        if asked.get("version") != [self._files.version]:
            self._outbox.tell(events.WRONG_VERSION_PAGE())
            await connection.close(OLD_PAGE, "this page is of another version: load it again")
            return
        video = self._video.get(asked.get("camera", [FIRST])[0]) if path == VIDEO else None
        if path == VIDEO and video is None:
            await connection.close(TOO_MANY, "this drone has no such camera")
            return
        if video is not None:
            await video.page(connection)
            return
        watchers = path == WATCH and len(self._watchers) >= MOST_WATCHERS
        if watchers or len(self._pages) >= MOST_PAGES:
            self._outbox.tell(events.TOO_MANY_PAGES())
            kind = f"{MOST_WATCHERS} watchers'" if path == WATCH else str(MOST_PAGES)
            await connection.close(TOO_MANY, f"{kind} pages are open already")
            return
        sock = connection.transport.get_extra_info("socket")
        sock.setsockopt(socket.SOL_SOCKET, socket.SO_SNDBUF, SEND_BUFFER)
        self._last += 1
        number = self._last
        self._pages[number] = connection
        if path == WATCH:
            self._watchers.add(number)
        self._add(PageOpened(number, path == WATCH))
        try:
            async for raw in said(connection, self._outbox):
                self._add(PageSaid(number, parsed(raw)))
        except ConnectionClosed as closed:
            if closed.sent is not None and closed.sent.code == TOO_BIG:
                self._outbox.tell(events.OVERSIZED_PAGE())
        finally:
            del self._pages[number]
            self._watchers.discard(number)
            self._add(PageClosed(number))

    def _add(self, event: PageEvent) -> None:
        with self._lock:
            match self._events[-1] if self._events else None, event:
                case PageSaid(page, PageSticks()), PageSaid(sender, PageSticks()) if page == sender:
                    self._events.pop()  # of stick positions only the newest counts
                case _, PageSaid() if len(self._events) >= WAITING:
                    self._outbox.tell(events.OVERFLOWED("page"))
                    return
                case _:
                    pass
            self._events.append(event)
        self._notify()

    def _send(self, texts: Mapping[int, str]) -> None:
        for number, text in texts.items():
            connection = self._pages.get(number)
            if connection is None:
                continue
            if connection.transport.get_write_buffer_size() > 0:
                self._outbox.tell(events.DROPPED_PAGE())
            else:
                broadcast([connection], text)

    def opened(self) -> bool:
        """A connection was opened. False: there are too many."""
        self.connections += 1
        self._outbox.tell(events.TOO_MANY_CONNECTIONS(), self.connections > MOST_CONNECTIONS)
        return self.connections <= MOST_CONNECTIONS


class CountedConnection(ServerConnection):
    """Closed at once where there are too many, before it may say anything."""

    def __init__(self, pages: PageServer, *args: Any, **more: Any) -> None:
        super().__init__(*args, **more)
        self._all = pages

    def connection_made(self, transport: asyncio.BaseTransport) -> None:
        admitted = self._all.opened()
        super().connection_made(transport)
        if not admitted:
            self.transport.abort()

    def connection_lost(self, exc: Exception | None) -> None:
        self._all.connections -= 1
        super().connection_lost(exc)


def _tls(settings: Settings) -> ssl.SSLContext | None:
    if not settings.certificate:
        return None
    for name, file in (("certificate", settings.certificate), ("key", settings.key)):
        if not Path(file).is_file():
            raise LindyError(f"cockpit.{name} {file!r}: there is no such file; expected a PEM file")
    context = ssl.SSLContext(ssl.PROTOCOL_TLS_SERVER)
    try:
        context.load_cert_chain(settings.certificate, settings.key)
    except (OSError, ssl.SSLError) as error:
        raise LindyError(
            f"cockpit.certificate {settings.certificate} with cockpit.key {settings.key} cannot be "
            f"used: {error}; expected two PEM files"
        ) from None
    return context
