"""Where doubles speak: a TCP server, a pseudo-terminal."""

import os
import pty
import socket
import threading
import tty
from collections.abc import Callable
from contextlib import suppress
from pathlib import Path

from tests.support.patience import PATIENCE_S

Answers = Callable[[bytes], bytes]


class TcpInstrument:
    """One that speaks to whoever connects. Its power can be cut and come back."""

    def __init__(self, answers: Answers = lambda _: b"") -> None:
        self._answers = answers
        self._clients: list[socket.socket] = []
        self._threads: list[threading.Thread] = []
        self._listener: socket.socket | None = None
        self.port = 0
        self.power_on()

    def power_on(self) -> None:
        self._listener = socket.create_server(("127.0.0.1", self.port))
        self.port = self._listener.getsockname()[1]
        self._start(self._accept, self._listener)

    def power_off(self) -> None:
        """Connections end without a word."""
        assert self._listener is not None
        for end in (self._listener, *self._clients):
            with suppress(OSError):
                end.shutdown(socket.SHUT_RDWR)
            end.close()
        self._clients.clear()
        for thread in self._threads:
            thread.join(PATIENCE_S)
        self._threads.clear()

    def says(self, data: bytes) -> bool:
        """To everybody who is connected. False: nobody is."""
        for client in list(self._clients):
            with suppress(OSError):
                client.sendall(data)
        return bool(self._clients)

    def _start(self, run: Callable[[socket.socket], None], end: socket.socket) -> None:
        thread = threading.Thread(target=run, args=(end,), daemon=True)
        self._threads.append(thread)
        thread.start()

    def _accept(self, listener: socket.socket) -> None:
        with suppress(OSError):
            while True:
                client, _ = listener.accept()
                self._clients.append(client)
                self._start(self._listen, client)

    def _listen(self, client: socket.socket) -> None:
        with suppress(OSError):
            while data := client.recv(4096):
                for line in data.splitlines(keepends=True):
                    if reply := self._answers(line):
                        client.sendall(reply)


class SerialInstrument:
    """One at a pseudo-terminal, which has a name in a folder, as of /dev/serial/by-id."""

    def __init__(self, name: Path) -> None:
        self.name = name
        self._end, self._other = pty.openpty()
        tty.setraw(self._other)
        name.symlink_to(os.ttyname(self._other))

    def says(self, data: bytes) -> None:
        os.write(self._end, data)

    def hears(self) -> bytes:
        """What was written to it since; waits for something."""
        return os.read(self._end, 4096)

    def unplug(self) -> None:
        self.name.unlink()
        os.close(self._other)
        os.close(self._end)
