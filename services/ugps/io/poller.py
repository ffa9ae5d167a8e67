"""Asks a server for the same pages again and again, on a thread of its own."""

import threading
import time
from collections import deque
from collections.abc import Callable, Sequence
from http.client import HTTPConnection, HTTPException
from urllib.parse import urlsplit

from messages import events
from messages.events import Outbox
from services.mavlink_io.io.links import Received
from services.runtime.config.errors import LindyError

TIMEOUT_S = 2.0  # [s] of an answer
LONGEST = 65_536  # [bytes] of an answer


class HttpPoller:
    """Links to one server: what arrives is, for each round of questions, the answer to each. A
    status other than 200 is `HTTP` and its number."""

    def __init__(
        self, url: str, setting: str, paths: Sequence[str], period_s: float, outbox: Outbox
    ) -> None:
        """
        Args:
            setting: where the URL comes from, for people.
            outbox: told of answers that nobody came for.

        Raises:
            LindyError: it is no http URL.
        """
        try:
            parts = urlsplit(url)
            known = parts.scheme == "http" and parts.hostname and parts.path in ("", "/")
            self._address = parts.hostname or "", parts.port or 80
        except ValueError:  # of the port
            known = False
        if not known:
            raise LindyError(f"{setting}: found {url!r}; allowed: http://HOST or http://HOST:PORT")
        self.names, self.trouble = list[str](), ""  # nothing can be sent
        self._paths, self._period_s = paths, period_s
        self._rounds, self._outbox = deque[Received](maxlen=4), outbox
        self._over = threading.Event()
        self._notify: Callable[[], None] = lambda: None
        self._thread = threading.Thread(target=self._run, name="http", daemon=True)

    def start(self, notify: Callable[[], None]) -> None:
        self._notify = notify
        self._thread.start()

    def receive(self) -> list[Received]:
        found = list[Received]()
        while self._rounds:
            found.append(self._rounds.popleft())
        return found

    def send(self, link: str, frame: bytes) -> None:
        """There is nobody to send to."""

    def again(self, why: str) -> None:
        """It connects anew by itself."""

    def close(self) -> None:
        self._over.set()
        self._thread.join(TIMEOUT_S)

    def _run(self) -> None:
        connection = HTTPConnection(*self._address, timeout=TIMEOUT_S)
        due = time.monotonic()
        while not self._over.wait(max(0.0, due - time.monotonic())):
            due = max(due + self._period_s, time.monotonic())
            try:
                answers = [_asked(connection, path) for path in self._paths]
            except (OSError, HTTPException) as error:
                connection.close()  # and is opened by the next question
                self.trouble = str(error) or type(error).__name__
                continue
            self.trouble = ""
            self._outbox.tell(events.OVERFLOWED("ugps"), len(self._rounds) == self._rounds.maxlen)
            self._rounds.append(Received("http", answers))
            self._notify()
        connection.close()


def _asked(connection: HTTPConnection, path: str) -> bytes:
    """
    Raises:
        OSError: it cannot be reached.
        HTTPException: what it answers is not HTTP.
    """
    connection.request("GET", path, headers={"Accept": "application/json"})
    answer = connection.getresponse()
    body = answer.read(LONGEST)
    if answer.read(1):
        connection.close()  # the rest of it is of no use
    return body if answer.status == 200 else f"HTTP {answer.status}".encode()
