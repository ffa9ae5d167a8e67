"""Who comes to a hub from another machine, who leaves, and who is cut off."""

import contextlib
import sys
import time
from collections import Counter
from collections.abc import Sequence
from typing import Literal

import msgspec

from messages.health import LogLine
from services.runtime.bus.budgets import Budgets, Verdict
from services.runtime.bus.envelope import Say
from services.runtime.bus.tcp_links import Ends, TcpLinks, let_callers_speak_first

Level = Literal["info", "warning"]
LOOK_S = 0.05  # [s] between two looks at what the links have sent


class Doorkeeper:
    """Says in the hub's log who connects and who leaves: for each, the first, tenth, hundredth …
    time, because who is not admitted may try for hours. Whoever has used up the budget of its role
    is cut off, which all screens are told.

    `see` is called on Zenoh's thread, `look` by the hub's own loop.
    """

    def __init__(self, hub: str, admitted: Sequence[str], say: Say) -> None:
        """
        Args:
            hub: its name in the log.
            say: puts an encoded log line on the bus.
        """
        self._hub, self._say = hub, say
        self._admitted = frozenset(admitted)
        self._budgets = Budgets(self._admitted)
        self._links: dict[Ends, str] = {}  # names by their links
        self._times: Counter[tuple[str, bool]] = Counter()
        self._said = 0  # lines
        self._tcp = TcpLinks()
        let_callers_speak_first()

    def see(self, name: str, connected: bool, link: Ends) -> None:
        """Somebody has connected or left."""
        if connected:
            self._links[link] = name
            if self._budgets.barred(name, time.monotonic_ns()):
                self._tcp.ignore([link])
        else:
            self._links.pop(link, None)
        self._times[name, connected] += 1
        times = self._times[name, connected]
        if str(times).rstrip("0") == "1":
            self._print(*self._in_words(name, connected, times))

    def look(self, now: int) -> None:
        """Call it every `LOOK_S`: cut off at `now` [ns] whoever sends too much."""
        links = dict(self._links)
        sent = self._tcp.received(links)
        unwanted = self._budgets.beyond(links, now)
        for verdict in self._budgets.look(links, sent, now):
            if verdict.what == "cut":
                unwanted += [link for link, name in links.items() if name == verdict.name]
            self._tell(in_words(verdict), now)
        self._tcp.cut(unwanted)

    def _tell(self, text: str, now: int) -> None:
        """To the log and to everybody on the bus."""
        line = LogLine(stamp_ns=now, seq=self._said, service=self._hub, level="warning", text=text)
        self._said += 1
        self._say(msgspec.msgpack.encode(line))
        self._print("warning", text)

    def _in_words(self, name: str, connected: bool, times: int) -> tuple[Level, str]:
        again = "" if times == 1 else f" ({times} times)"
        what = f"{name} {'connected' if connected else 'left'}{again}"
        if name in self._admitted:
            return "info", what
        return "warning", f"{what}; it is not admitted, and can neither hear nor say anything"

    def _print(self, level: Level, text: str) -> None:
        with contextlib.suppress(OSError):  # a full disk under the log
            print(f"{level} hub: {text}", file=sys.stderr, flush=True)


def in_words(verdict: Verdict) -> str:
    what = "has too many links" if verdict.why == "too many links" else "sends too much"
    if verdict.what == "warn":
        return f"{verdict.name} {what}: it is cut off if it goes on"
    return f"{verdict.name} {what}: it is cut off for {verdict.barred_s:g} s"
