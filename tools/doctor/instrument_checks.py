"""What the instruments of a stack say: they are listened to, and asked; nothing is set up."""

from collections.abc import Callable, Collection, Iterator, Mapping
from dataclasses import dataclass
from typing import Any

from messages import events
from messages.events import Outbox
from messages.units import Ns
from services.instruments.core import GARBLED
from services.instruments.io.shell import Instrument, exchange
from services.nmea import service as nmea
from services.ping import service as ping
from services.runtime.config.errors import LindyError
from services.runtime.config.stack import Stack
from services.ugps import service as ugps
from services.waterlinked import service as waterlinked
from tools.doctor.board_checks import VehicleFinding

INSTRUMENTS: dict[str, Callable[[Stack, str, Outbox], Instrument[Any] | None]] = {
    "waterlinked": waterlinked.opened,
    "ping": ping.opened,
    "nmea": nmea.opened,
    "ugps": ugps.opened,
}
STACK = "ardusub_instruments"  # that has all of them
S = 1_000_000_000  # [ns]
CUT = 1  # report that was under way when it was opened


@dataclass(slots=True)
class HeardInstrument:
    """An instrument, and what was heard of it."""

    instrument: Instrument[Any]
    outbox: Outbox
    samples: int = 0  # after those that came with the first
    first_ns: Ns | None = None
    newest_ns: Ns = 0

    def look(self, now: Ns) -> None:
        found = exchange(self.instrument, lambda: now, now)
        if found and self.first_ns is not None:
            self.samples, self.newest_ns = self.samples + len(found), now
        elif found:
            self.first_ns = now

    @property
    def rate(self) -> str:
        """Of what it measures."""
        if self.first_ns is None:
            return "it answers, and measures nothing now, as in air or under a roof"
        if not self.samples:
            return "it measured once"
        return f"{self.samples * S / (self.newest_ns - self.first_ns):.1f} samples a second"


def wanted(tree: Mapping[str, Any]) -> list[str]:
    """The instruments that a vehicle file has."""
    tables = {name: tree.get(name) for name in INSTRUMENTS}
    return [n for n, table in tables.items() if isinstance(table, dict) and table.get("url")]


def of_instruments(
    stack: Stack,
    tree: Mapping[str, Any],
    services: Collection[str],
    seconds: float,
    now: Callable[[], Ns],
    wait: Callable[[], None],
) -> Iterator[VehicleFinding]:
    """
    Args:
        tree: of the vehicle file.
        seconds: [s] for which all of them are listened to.
        wait: until the next look at their links.
    """
    heard = dict[str, HeardInstrument]()
    for name in wanted(tree):
        if name not in services:
            told = f"has a url, and the stack {stack.services} no such service; --stack {STACK} has"
            yield VehicleFinding("change", name, told)
            continue
        outbox = Outbox()
        try:
            instrument = INSTRUMENTS[name](stack, name, outbox)
        except LindyError as error:
            yield VehicleFinding("change", name, str(error))
            continue
        assert instrument is not None
        heard[name] = HeardInstrument(instrument, outbox)
    listen(heard.values(), seconds, now, wait)
    for name, one in heard.items():
        yield finding(name, tree[name]["url"], seconds, one)


def listen(
    heard: Collection[HeardInstrument],
    seconds: float,
    now: Callable[[], Ns],
    wait: Callable[[], None],
) -> None:
    for one in heard:
        one.instrument.driver.watch.only_asks = True
        one.instrument.links.start(lambda: None)
    ends = now() + round(seconds * S)
    try:
        while heard and (at := now()) < ends:
            for one in heard:
                one.look(at)
            wait()
    finally:
        for one in heard:
            one.instrument.links.close()


def finding(name: str, url: str, seconds: float, heard: HeardInstrument) -> VehicleFinding:
    driver, links = heard.instrument
    garbled = heard.outbox.counts[events.MALFORMED(driver.watch.name).name]
    if not driver.told:
        why = GARBLED if garbled else links.trouble or "is it on, and is the url right?"
        return VehicleFinding("missing", name, f"no report at {url} in {seconds:g} s: {why}")
    told = f"{url}: {heard.rate}; {driver.told}"
    said = (text for level, text, _ in heard.outbox.said if level == "warning")
    troubles = list(dict.fromkeys(said))
    if garbled > CUT:
        troubles.append(f"{garbled} others could not be read")
    return VehicleFinding("change" if troubles else "ok", name, "; ".join([told, *troubles]))
