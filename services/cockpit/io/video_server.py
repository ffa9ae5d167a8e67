"""The camera's picture to the pages, each over a WebSocket of its own: a keyframe that takes its
time holds up neither sticks nor the state of the drone. On the thread of the page server."""

import time

from websockets.asyncio.server import ServerConnection, broadcast
from websockets.exceptions import ConnectionClosed

from messages import events
from messages.events import Outbox
from services.cockpit.io.message_rate import MessageRate
from services.cockpit.video import PageUnit, PageVideo, RecentUnits

MOST_VIDEO_PAGES = 32
LONGEST_CONFIRMATION = 10  # [B] a number


class VideoServer:
    def __init__(self, outbox: Outbox) -> None:
        self._outbox = outbox
        self._pages: dict[ServerConnection, PageVideo] = {}
        self._recent = RecentUnits()

    @property
    def full(self) -> bool:
        return len(self._pages) >= MOST_VIDEO_PAGES

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
            await self._read(connection, video)
        except ConnectionClosed:
            pass
        finally:
            del self._pages[connection]

    async def _read(self, connection: ServerConnection, video: PageVideo) -> None:
        rate = MessageRate()
        async for raw in connection:
            if rate.too_many():
                self._outbox.tell(events.TOO_MANY_PAGE_MESSAGES())
                return
            is_number = len(raw) <= LONGEST_CONFIRMATION and raw.isascii() and raw.isdigit()
            if not (is_number and video.confirmed(int(raw))):
                self._outbox.tell(events.MALFORMED_PAGE())
