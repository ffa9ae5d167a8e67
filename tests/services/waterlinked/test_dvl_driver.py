"""What a DVL says becomes samples: laws of the core, and each fault of the double."""

from collections.abc import Iterable
from contextlib import closing
from math import nan

import pytest
from hypothesis import given
from hypothesis import strategies as st

from messages.events import Outbox
from messages.sensors import DvlSample
from services.instruments.io.shell import Instrument, exchange, limits_of
from services.marine.mounting import ALONG, Mount, Mounting, Rotation
from services.mavlink_io.io.links import Links
from services.vehicle.mounting import AtOrigin
from services.waterlinked.core import LEAST_STD, LONGEST, DvlDriver, DvlReport, Settings
from tests.support.instruments.dvl import (
    DvlFaults,
    DvlSettings,
    Fault,
    position,
    report,
)
from tests.support.instruments.ports import TcpInstrument
from tests.support.instruments.truth import SeenMotion
from tests.support.patience import until

S = 1_000_000_000
SWIMS = SeenMotion(velocity=(0.5, -0.2, 0.05), altitude=2.0)
BACK = ((-1.0, 0.0, 0.0), (0.0, -1.0, 0.0), (0.0, 0.0, 1.0))


class Told:
    """A driver, and what it told."""

    def __init__(self, settings: Settings | None = None, mounted: Rotation = ALONG) -> None:
        self.outbox = Outbox()
        self.driver = DvlDriver(settings or Settings(), self.outbox, mounted)
        self.now = 100 * S

    def hears(self, *lines: bytes, at: int | None = None) -> list[DvlSample]:
        if at is not None:
            self.now = at
        return list(self.driver.heard(lines, self.now))

    @property
    def counts(self) -> dict[str, int]:
        return dict(self.outbox.counts)

    @property
    def said(self) -> list[str]:
        return [text for _, text, _ in self.outbox.said]

    def sends(self, settings: DvlSettings, now: int | None = None) -> Iterable[bytes]:
        """What it sends, answered."""
        sent = self.driver.due(self.now if now is None else now)
        self.hears(*(settings.answers(line) for line in sent))
        return sent


def faulty(*kinds: Fault, latency: float = 0.1, mounted: float = 0.0) -> DvlFaults:
    return DvlFaults(frozenset(kinds), latency, mounted)


@given(st.floats(0.0, 0.25), st.floats(-2.0, 2.0), st.floats(0.05, 50.0), st.integers(0, 99))
def test_a_sample_is_what_was_measured_then(
    latency: float, speed: float, altitude: float, seed: int
) -> None:
    """Whatever its clock says: arrival less the time from the echo to the report."""
    motion = SeenMotion(velocity=(speed, 0.1, 0.0), altitude=altitude)
    (sample,) = Told().hears(report(motion, 7.0, seed, faulty(latency=latency)))
    assert sample.stamp_ns == pytest.approx(100 * S - latency * S, abs=1_000)
    assert sample.velocity == pytest.approx(motion.velocity, abs=6 * sample.std)
    assert sample.altitude == pytest.approx(altitude)
    assert sample.std >= LEAST_STD


@given(st.lists(st.integers(1, 300), max_size=8), st.integers(0, 999))
def test_a_line_may_arrive_in_any_pieces(cuts: list[int], seed: int) -> None:
    data = report(SWIMS, 1.0, seed) + position(SWIMS, 1.1) + report(SWIMS, 1.2, seed)
    told, samples = Told(), list[DvlSample]()
    for cut in cuts:
        told.now += 1_000_000
        samples += told.hears(data[:cut])
        data = data[cut:]
    told.now += 1_000_000
    samples += told.hears(data)
    assert len(samples) == 2
    assert not any(name.startswith("malformed") for name in told.counts)


def test_reports_that_arrive_together_are_as_far_apart_as_they_were_measured() -> None:
    together = [report(SWIMS, t, 0, faulty(latency=0.1)) for t in (1.0, 1.1, 1.2)]
    stamps = [sample.stamp_ns for sample in Told().hears(*together)]
    assert stamps == pytest.approx([99.7 * S, 99.8 * S, 99.9 * S], abs=1_000)


@pytest.mark.parametrize("kind", ["no_lock", "air"])
def test_without_lock_there_is_no_velocity_and_it_is_alive(kind: Fault) -> None:
    told = Told()
    (sample,) = told.hears(report(SWIMS, 1.0, 0, faulty(kind)))
    assert (sample.velocity, sample.altitude) == (None, None)
    assert not any(name.startswith("implausible") for name in told.counts)
    told.hears(report(SWIMS, 2.0, 0, faulty(kind)), at=101 * S)
    assert told.counts.get("trouble:dvl", 0) == (kind == "air")  # it is too hot, said once


@pytest.mark.parametrize("kind", ["nan", "other_device"])
def test_what_is_no_report_is_counted_and_gives_no_sample(kind: Fault) -> None:
    told = Told()
    assert told.hears(report(SWIMS, 1.0, 0, faulty(kind))) == []
    assert told.counts == {"malformed:dvl": 1}


def test_a_negative_altitude_is_none() -> None:
    told = Told()
    (sample,) = told.hears(report(SWIMS, 1.0, 0, faulty("negative_altitude")))
    assert sample.altitude is None
    assert sample.velocity is not None
    assert told.counts["implausible:altitude"] == 1


@pytest.mark.parametrize("kind", ["future", "old_firmware"])
def test_without_times_that_can_be_the_latency_of_the_settings_counts(kind: Fault) -> None:
    told = Told(Settings(latency=0.2))
    (sample,) = told.hears(report(SWIMS, 1.0, 0, faulty(kind)))
    assert sample.stamp_ns == 100 * S - 200_000_000
    assert ("implausible:time_of_validity" in told.counts) is (kind == "future")


def test_another_firmware_is_read_and_said_once() -> None:
    told = Told()
    for n in range(3):
        assert told.hears(report(SWIMS, float(n), 0, faulty("new_firmware")), at=(100 + n) * S)
    assert len([text for text in told.said if "json_v9" in text]) == 1


@given(st.one_of(st.just(nan), st.floats(-1.0, 1.0)), st.floats(0.0, 1.0))
def test_the_standard_deviation_is_the_largest_that_is_said(variance: float, fom: float) -> None:
    covariance = [[variance, 0.0, 0.0], [0.0, 0.0, 0.0], [0.0, 0.0, 9.0]]
    std = DvlReport(fom=fom, covariance=covariance).std
    assert std == max(LEAST_STD, fom, variance**0.5 if variance > 0 else 0.0)


def test_an_endless_line_is_left_out_and_the_next_is_read() -> None:
    told = Told()
    for _ in range(10):
        told.hears(b"x" * LONGEST)
    assert len(told.hears(b"x\n", report(SWIMS, 1.0, 0))) == 1
    assert told.counts["malformed:dvl"] == 1


@pytest.mark.parametrize("mounted", [0.0, 90.0, 180.0])
def test_an_instrument_that_is_turned_gives_the_velocity_of_the_vehicle(mounted: float) -> None:
    """By the vehicle file's rotation; and the instrument's own is taken back, so that the two never
    add up."""
    turned = {
        0.0: ALONG,
        90.0: ((0.0, -1.0, 0.0), (1.0, 0.0, 0.0), (0.0, 0.0, 1.0)),
        180.0: BACK,
    }[mounted]
    settings = DvlSettings(mounting_rotation_offset=33.0)
    told = Told(mounted=turned)
    told.hears(report(SWIMS, 0.9, 0, faulty(mounted=mounted)))
    told.sends(settings)
    told.sends(settings)
    offset = settings.config["mounting_rotation_offset"]
    assert offset == (33.0 if mounted == 0.0 else 0)
    if mounted:
        line = report(SWIMS, 1.0, 0, faulty(mounted=mounted), offset)
        (sample,) = told.hears(line, at=101 * S)
        at_origin = AtOrigin(Mounting(dvl=Mount(rotation=turned)), 1025.0)
        assert at_origin.dvl(sample).velocity == pytest.approx(SWIMS.velocity, abs=0.03)
    else:
        assert any("turns its axes by 33" in text for text in told.said)


def test_it_is_set_up_at_the_start_and_whenever_it_comes_back() -> None:
    told = Told(Settings(sound_speed=1500.0, calibrate_on_start=True))
    settings = DvlSettings(acoustic_enabled=False)
    assert told.sends(settings) == []  # it has not spoken yet
    told.hears(report(SWIMS, 1.0, 0))
    told.sends(settings)
    told.sends(settings)
    assert settings.config["acoustic_enabled"] is True
    assert settings.config["speed_of_sound"] == 1500.0
    wanted = ["calibrate_gyro", "get_config", "set_config"]
    assert settings.done == wanted
    assert told.sends(settings) == []
    told.driver.watch.gives_up(110 * S)
    told.hears(report(SWIMS, 11.0, 0), at=111 * S)
    told.sends(settings)
    assert settings.done == [*wanted, "get_config"]  # a gyroscope is not calibrated in the water


def test_a_refusal_is_said() -> None:
    told = Told(Settings(calibrate_on_start=True))
    told.hears(report(SWIMS, 1.0, 0))
    told.hears(DvlSettings().answers(b'{"command":"reset_everything"}'))
    assert told.counts["not_configured:dvl"] == 1
    assert any("Unknown command" in text for text in told.said)


def test_one_that_never_answers_is_asked_five_times() -> None:
    told, asked = Told(), 0
    for n in range(100):
        told.hears(report(SWIMS, float(n), 0), at=(100 + n) * S)
        asked += len(told.driver.due(told.now))
    assert asked == 5


@pytest.mark.parametrize(
    ("seen", "why"),
    [
        (SeenMotion(velocity=(1e9, 0.0, 0.0), altitude=2.0), "e+08 m/s"),
        (SeenMotion(velocity=(0.5, 0.0, 0.0), altitude=-3.0), "an altitude of -3 m"),
    ],
)
def test_what_cannot_be_is_said_once_when_it_has_lasted(seen: SeenMotion, why: str) -> None:
    told = Told()
    for k in range(60):
        told.hears(report(seen, k / 10, 0), at=(100 * S) + k * S // 10)
    (said,) = [text for text in told.said if "cannot be" in text]
    assert why in said
    assert "-3" not in told.driver.told
    told.hears(report(SWIMS, 9.0, 0), at=110 * S)
    assert len([text for text in told.said if "cannot be" in text]) == 1


def test_a_velocity_that_no_vehicle_has_is_not_passed_on() -> None:
    assert not Told().hears(report(SeenMotion(velocity=(0.0, 16.0, 0.0), altitude=2.0), 1.0, 0))


# The driver and the double on a real connection; the time is the test's.


class Board:
    """A driver on its connection."""

    def __init__(self, port: int) -> None:
        self.outbox = Outbox()
        self.driver = DvlDriver(Settings(url=f"tcp:127.0.0.1:{port}"), self.outbox)
        self.links = Links(
            [f"tcp:127.0.0.1:{port}"], "waterlinked.url", limits_of("dvl"), self.outbox
        )
        self.links.start(lambda: None)
        self.now = 100 * S
        self.samples = list[DvlSample]()

    def look(self) -> None:
        """A tenth of a second later."""
        self.now += S // 10
        self.samples += exchange(Instrument(self.driver, self.links), lambda: self.now, self.now)

    def hears(self, dvl: TcpInstrument, more: int = 3) -> bool:
        """What the DVL says now, until there are so many samples more."""
        wanted = len(self.samples) + more

        def enough() -> bool:
            dvl.says(report(SWIMS, self.now / S, 0))
            return len(self.samples) >= wanted

        return until(enough, meanwhile=self.look)


def test_it_connects_hears_sets_up_and_is_heard_again_when_its_power_is_back() -> None:
    config = DvlSettings(acoustic_enabled=False)
    dvl = TcpInstrument(config.answers)
    board = Board(dvl.port)
    counts = board.outbox.counts
    with closing(board.links):
        assert board.hears(dvl)
        until(lambda: config.config["acoustic_enabled"] is True, meanwhile=board.look)
        assert board.samples[0].velocity == pytest.approx(SWIMS.velocity, abs=0.03)
        dvl.power_off()
        until(lambda: counts["silent_instrument:dvl"] == 1, meanwhile=board.look)
        dvl.power_on()
        assert board.hears(dvl)
        assert (counts["silent_instrument:dvl"], counts["answering:dvl"]) == (1, 2)
    dvl.power_off()
