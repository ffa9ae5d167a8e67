"""`lindy doctor` at the doubles of instruments."""

import json
import threading
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from messages.events import Outbox
from services.instruments.core import LocalFixes
from services.instruments.io.shell import Instrument, InstrumentDriver
from services.mavlink_io.io.links import Received
from services.nmea.core import GnssDriver
from services.nmea.core import Settings as NmeaSettings
from services.nmea.io.sentences import NmeaReader
from services.ping.core import PingDriver
from services.ping.core import Settings as PingSettings
from services.runtime.config.settings import deploy_file
from services.ugps.core import PATHS, UgpsDriver
from services.ugps.core import Settings as UgpsSettings
from services.waterlinked.core import DvlDriver
from services.waterlinked.core import Settings as DvlSettings
from tests.support.instruments import dvl, gnss, ping1d, ugps
from tests.support.instruments.ports import TcpInstrument
from tests.support.instruments.truth import SeenMotion
from tests.support.patience import until
from tools.__main__ import main
from tools.doctor.board_checks import VehicleFinding
from tools.doctor.instrument_checks import HeardInstrument, finding, listen

S = 1_000_000_000
HERE = (63.4220, 10.4240)
SEEN = SeenMotion(velocity=(0.5, 0.0, 0.0), altitude=3.2)
Says = Callable[[float], list[bytes]]  # at [s]


class MemoryInstrument:
    """Links to a double in memory, which speaks at a rate and answers."""

    def __init__(self, hz: float, says: Says, answers: Callable[[bytes], bytes]) -> None:
        self.names, self.trouble = ["it"], ""
        self.now, self._hz, self._said = 100.0, hz, 0
        self._says, self._answers, self._replies = says, answers, list[bytes]()

    def wait(self) -> None:
        self.now += 0.005

    def start(self, notify: Callable[[], None]) -> None: ...

    def receive(self) -> list[Received]:
        found, self._replies = [Received("it", [reply]) for reply in self._replies if reply], []
        while self._said < (self.now - 100.0) * self._hz:
            self._said += 1
            found.append(Received("it", self._says(self.now)))
        return found

    def send(self, link: str, frame: bytes) -> None:
        assert link == "it"
        self._replies.append(self._answers(frame))

    def again(self, why: str) -> None: ...

    def close(self) -> None: ...


def visited(
    driver: InstrumentDriver[Any],
    outbox: Outbox,
    hz: float,
    says: Says,
    answers: Callable[[bytes], bytes] = lambda _: b"",
) -> VehicleFinding:
    links = MemoryInstrument(hz, says, answers)
    heard = HeardInstrument(Instrument(driver, links), outbox)
    listen([heard], 5.0, lambda: round(links.now * S), links.wait)
    return finding("it", "tcp:x:1", 5.0, heard)


def of_gnss(says: Says, hz: float = 5.0) -> VehicleFinding:
    outbox = Outbox()
    fixes = LocalFixes("gnss", outbox, HERE)
    return visited(GnssDriver(NmeaSettings(), fixes, outbox, NmeaReader().read), outbox, hz, says)


def test_a_dvl_tells_its_rate_and_lock_and_is_left_as_it_is() -> None:
    outbox, settings = Outbox(), dvl.DvlSettings(acoustic_enabled=False, speed_of_sound=1400)
    driver = DvlDriver(DvlSettings(sound_speed=1500.0, calibrate_on_start=True), outbox)
    found = visited(driver, outbox, 8.0, lambda t: [dvl.report(SEEN, t, 0)], settings.answers)
    assert (found.verdict, found.text) == (
        "ok", "tcp:x:1: 8.0 samples a second; json_v3, 3.20 m high"
    )  # fmt: skip
    assert settings.done == ["get_config"]


def test_trouble_of_an_instrument_is_something_to_change() -> None:
    outbox, hot = Outbox(), dvl.DvlFaults(frozenset({"air"}))
    says: Says = lambda t: [dvl.report(SEEN, t, 0, hot)]  # noqa: E731
    found = visited(DvlDriver(DvlSettings(), outbox), outbox, 1.0, says)
    assert found.verdict == "change"
    assert "no bottom lock; an instrument on board reports trouble" in found.text
    assert "too hot" in found.text


def test_an_echo_sounder_tells_its_firmware_and_how_sure_it_is() -> None:
    outbox, double = Outbox(), ping1d.Ping1dDouble()
    double.motion = SEEN
    found = visited(PingDriver(PingSettings(), outbox), outbox, 1.0, lambda _: [], double.answers)
    assert found.verdict == "ok"
    assert "10.0 samples a second; firmware 3.29.0, 98 % sure of 3." in found.text
    double = ping1d.Ping1dDouble(faults=frozenset({"air"}))
    found = visited(PingDriver(PingSettings(), outbox), outbox, 1.0, lambda _: [], double.answers)
    assert (found.verdict, "measures nothing now, as in air" in found.text) == ("ok", True)


def test_a_receiver_tells_how_good_its_position_is_or_that_it_has_none() -> None:
    found = of_gnss(lambda t: [gnss.epoch(SEEN, t, 0, HERE)])
    assert (found.verdict, found.text) == (
        "ok",
        "tcp:x:1: 5.0 samples a second; GGA of quality 1, good to 2.5 m",
    )
    found = of_gnss(lambda t: [gnss.epoch(SEEN, t, 0, HERE, frozenset({"no_fix"}))])
    assert (
        found.verdict,
        "measures nothing now, as in air or under a roof; no position" in found.text,
    ) == ("ok", True)


def test_an_underwater_gps_tells_how_good_its_position_is() -> None:
    outbox = Outbox()

    def says(t: float) -> list[bytes]:
        said = ugps.answers(SEEN, t, 0, HERE, frozenset())
        return [said[path] for path in PATHS]

    driver = UgpsDriver(UgpsSettings(), LocalFixes("ugps", outbox, HERE), outbox)
    found = visited(driver, outbox, 2.0, says)
    assert (found.verdict, found.text) == (
        "ok", "tcp:x:1: 2.0 samples a second; a position good to 0.7 m"
    )  # fmt: skip


@pytest.mark.parametrize(
    ("hz", "said", "why"),
    [(0.0, b"", "is it on, and is the url right?"), (5.0, b"\xff\x00" * 20, "this speed of the c")],
)
def test_one_that_is_silent_or_not_understood_is_missing(hz: float, said: bytes, why: str) -> None:
    found = of_gnss(lambda _: [said * 10], hz)
    assert found.verdict == "missing"
    assert found.text.startswith("no report at tcp:x:1 in 5 s: ")
    assert why in found.text


def no_findings(*_: object) -> list[VehicleFinding]:
    return []


def test_the_verb_asks_each_instrument_of_the_vehicle_file(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("tools.doctor.command._of_board", no_findings)
    speaks, over = TcpInstrument(), threading.Event()
    file = tmp_path / "mine.toml"
    file.write_text(
        deploy_file("vehicles", "pioneer").read_text()
        + f'\n[waterlinked]\nurl = "tcp:127.0.0.1:{speaks.port}"\n'
        + '[ping]\nurl = "serial:/dev/ttyNONE*:115200"\n[ugps]\nurl = "box"\n'
    )

    def speak() -> None:
        t = 0.0
        while not over.wait(0.05):  # a DVL of 20 samples a second
            t += 0.05
            speaks.says(dvl.report(SEEN, t, 0))

    thread = threading.Thread(target=speak)
    thread.start()
    words = ["doctor", "--vehicle", str(file), "--seconds", "0.5", "--json"]
    found = dict[str, tuple[str, str]]()

    def visited() -> bool:
        main([*words, "--stack", "simulated"])
        assert "--stack ardusub_instruments has" in capsys.readouterr().out
        main(words)
        said = json.loads(capsys.readouterr().out)["findings"]
        found.update({one["what"]: (one["verdict"], one["text"]) for one in said})
        return found["waterlinked"][0] == "ok"

    until(visited)
    over.set()
    thread.join()
    speaks.power_off()
    assert found["ping"] == (
        "missing",
        "no report at serial:/dev/ttyNONE*:115200 in 0.5 s: No such file or directory",
    )
    assert found["ugps"][0] == "change"  # it may be there, and the file is wrong
    assert found["ugps"][1].startswith("ugps.url: found 'box'; allowed: http://HOST")
