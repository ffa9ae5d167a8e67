"""Stands before Foxglove's server and lets in whom `handshake.py` lets in."""

import asyncio
import random
import socket
import sys
import threading
from collections.abc import Callable
from contextlib import suppress

from services.foxglove.core import refusal

LONGEST_HEAD = 16_384  # [bytes]
HEAD_S = 5.0  # [s] for the head of a request
AT_ONCE = 65_536  # [bytes]
UNREAD_S = 10.0  # [s] in which a viewer takes what is sent at once
MOST = 32  # viewers
MOST_CONNECTIONS = 192  # with those that have not said yet what they are
CLOSE_S = 2.0  # [s]


def private_address() -> str:
    """Where the server behind this gate listens. A page that tries addresses of this machine would
    have to try 16 million, with 65,000 ports each; on others than Linux there is one."""
    if sys.platform != "linux":
        return "127.0.0.1"
    draw = random.SystemRandom().randrange
    return f"127.{draw(1, 255)}.{draw(0, 255)}.{draw(1, 255)}"


class FrontGate:
    """Passes on, both ways, what comes on connections that it lets in. On a thread of its own."""

    def __init__(
        self,
        host: str,
        port: int,
        behind: tuple[str, int],
        refused: Callable[[str], None],
        *,
        local: bool,
    ) -> None:
        """
        Args:
            behind: where the server listens.
            refused: told why somebody was refused, on another thread.

        Raises:
            OSError: the address cannot be used.
        """
        family = socket.AF_INET6 if ":" in host else socket.AF_INET
        self._socket = socket.create_server((host, port), family=family)
        self._port, self._behind, self._local = port, behind, local
        self._refused = refused
        self._open = self._viewers = 0  # connections; those of them that were let in
        self._loop = asyncio.new_event_loop()
        self._stop = asyncio.Event()
        self._thread = threading.Thread(target=self._run, daemon=True)
        self._thread.start()

    def close(self) -> None:
        self._loop.call_soon_threadsafe(self._stop.set)
        self._thread.join(CLOSE_S)

    def _run(self) -> None:
        asyncio.set_event_loop(self._loop)
        with suppress(RuntimeError):
            self._loop.run_until_complete(self._serve())
        self._loop.close()

    async def _serve(self) -> None:
        server = await asyncio.start_server(self._met, sock=self._socket, limit=LONGEST_HEAD)
        await self._stop.wait()
        server.close()
        others = [task for task in asyncio.all_tasks() if task is not asyncio.current_task()]
        for task in others:
            task.cancel()
        await asyncio.gather(*others, return_exceptions=True)

    async def _met(self, reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        self._open += 1
        try:
            if self._open > MOST_CONNECTIONS:
                self._refused("too many connections")
                writer.transport.abort()
                return
            with suppress(OSError, asyncio.IncompleteReadError, asyncio.LimitOverrunError):
                await self._let_in(reader, writer)
        finally:
            self._open -= 1
            writer.close()

    async def _let_in(self, reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        try:
            head = await asyncio.wait_for(reader.readuntil(b"\r\n\r\n"), HEAD_S)
        except TimeoutError:
            self._refused("a connection on which nothing was said")
            return
        why = refusal(head, self._port, local=self._local)
        why = "too many viewers" if not why and self._viewers >= MOST else why
        if why:
            self._refused(why)
            body = f"{why}\n".encode()
            status = b"HTTP/1.1 403 Forbidden\r\nConnection: close\r\nContent-Length: "
            writer.write(status + f"{len(body)}\r\n\r\n".encode() + body)
            await writer.drain()
            return
        self._viewers += 1
        try:
            inner, outer = await asyncio.open_connection(*self._behind, limit=AT_ONCE)
            ways = [_pass_on(reader, outer), _pass_on(inner, writer)]
            tasks = [asyncio.ensure_future(way) for way in ways]
            try:
                outer.write(head)
                done, _ = await asyncio.wait(tasks, return_when=asyncio.FIRST_COMPLETED)
                if any(isinstance(task.exception(), TimeoutError) for task in done):
                    self._refused("a viewer that does not read")
                    writer.transport.abort()  # what it has not read is not waited for
            finally:
                outer.close()  # first: what follows may be cancelled, as when the server ends
                for task in tasks:
                    task.cancel()
                await asyncio.gather(*tasks, return_exceptions=True)
        finally:
            self._viewers -= 1


async def _pass_on(reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
    """A reader that is slow makes the server wait, which then drops its oldest messages."""
    while data := await reader.read(AT_ONCE):
        writer.write(data)
        await asyncio.wait_for(writer.drain(), UNREAD_S)
