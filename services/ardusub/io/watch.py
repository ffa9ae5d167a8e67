"""A thread that waits until something can be read from the board, and says so."""

import select
import socket
import threading
import time
from collections.abc import Callable

PATIENCE_S = 0.1  # [s] after which it asks again where to wait: a connection may be another one
PAUSE_S = 0.003  # [s] between two calls: a flood or a pulled cable must not take the processor


class ArrivalWatch:
    """It reads nothing: that is done by whoever is notified, in time or later."""

    def __init__(self, descriptor: Callable[[], int], notify: Callable[[], None]) -> None:
        """
        Args:
            descriptor: of what is read from at present; -1 where there is nothing.
        """
        self._descriptor, self._notify = descriptor, notify
        self._closing, self._closed = socket.socketpair()
        self._thread = threading.Thread(target=self._watch, name="board", daemon=True)
        self._thread.start()

    def close(self) -> None:
        """It does not notify any more. Not to be called by the one who is notified."""
        self._closing.send(b".")
        self._thread.join(1.0)
        self._closing.close()
        self._closed.close()

    def _watch(self) -> None:
        may_notify = 0.0  # [s] monotonic time
        while True:
            descriptor = self._descriptor()
            where = [self._closed.fileno(), *([descriptor] if descriptor >= 0 else [])]
            try:
                ready = select.select(where, [], [], PATIENCE_S)[0]
            except (OSError, ValueError):  # closed by the other thread just now
                ready = []
                time.sleep(PAUSE_S)
            if where[0] in ready:
                return
            if ready:
                if (wait := may_notify - time.monotonic()) > 0.0:
                    time.sleep(wait)
                may_notify = time.monotonic() + PAUSE_S
                self._notify()
