"""What a receiver of GNSS says becomes fixes."""

from math import sqrt

import pytest
from hypothesis import given
from hypothesis import strategies as st

from messages.events import Outbox
from messages.sensors import UsblSample
from services.instruments.core import GeoPoint, LocalFixes
from services.nmea.core import RANGE_ERROR, GnssDriver, Settings
from services.nmea.io.sentences import NmeaReader
from tests.support.instruments.gnss import Fault, epoch, summed
from tests.support.instruments.truth import SeenMotion

S = 1_000_000_000
TRONDHEIM = (63.4220, 10.4240)
READ = NmeaReader().read


def driver_of(outbox: Outbox, origin: GeoPoint | None = TRONDHEIM) -> GnssDriver:
    return GnssDriver(Settings(), LocalFixes("gnss", outbox, origin), outbox, READ)


def fixes(*faults: Fault, seconds: int = 10, hdop: float = 0.9) -> tuple[list[UsblSample], Outbox]:
    outbox, found = Outbox(), list[UsblSample]()
    driver = driver_of(outbox)
    for n in range(seconds):
        said = epoch(SeenMotion(), float(n), 0, TRONDHEIM, frozenset(faults), hdop)
        found += driver.heard([said], (100 + n) * S)
    return found, outbox


@given(
    st.floats(-80.0, 80.0),
    st.floats(-179.9, 179.9),
    st.floats(-5_000.0, 5_000.0),
    st.floats(-5_000.0, 5_000.0),
)
def test_a_fix_is_where_the_vehicle_is(
    latitude: float, longitude: float, north: float, east: float
) -> None:
    outbox, origin = Outbox(), (latitude, longitude)
    motion = SeenMotion(north=north, east=east)
    (fix,) = driver_of(outbox, origin).heard([epoch(motion, 1.0, 0, origin)], 100 * S)
    assert (fix.north, fix.east) == pytest.approx((north, east), abs=3.0)  # of noise
    assert fix.stamp_ns == 100 * S - S // 5
    assert outbox.counts == {"answering:gnss": 1}


@pytest.mark.parametrize("hdop", [0.5, 2.0, 8.0])
def test_the_standard_deviation_follows_hdop(hdop: float) -> None:
    samples, _ = fixes(hdop=hdop)
    assert len(samples) == 10
    assert samples[0].std == pytest.approx(hdop * RANGE_ERROR[1] / sqrt(2.0))


@pytest.mark.parametrize("faults", [("no_fix",), ("no_fix", "rmc_only"), ("estimated",)])
def test_under_water_there_is_no_fix_and_one_sentence(faults: tuple[Fault, ...]) -> None:
    samples, outbox = fixes(*faults, seconds=600)
    assert samples == []
    assert outbox.counts == {"answering:gnss": 1, "no_fix:gnss": 1}


def test_one_that_does_not_know_the_time_has_a_position() -> None:
    said = epoch(SeenMotion(), 1.0, 0, TRONDHEIM).split(b"\r\n")[0].decode()[1:-3].split(",")
    body = ",".join([said[0], "", *said[2:]])
    driver = driver_of(Outbox())
    assert len([f for n in range(5) for f in driver.heard([summed(body)], (100 + n) * S)]) == 5


def test_one_that_never_says_a_position_is_said_once() -> None:
    outbox = Outbox()
    driver = driver_of(outbox)
    for n in range(100):
        driver.heard([summed("GPHDT,90.0,T")], n * S)
    assert outbox.counts == {"answering:gnss": 1, "no_fix:gnss": 1}
    assert driver.told == "neither GGA nor RMC among its sentences"


def test_a_position_that_is_said_again_is_one_fix() -> None:
    samples, outbox = fixes("frozen")
    assert len(samples) == outbox.counts["no_fix:gnss"] == 1


@pytest.mark.parametrize("fault", ["bad_sum", "no_sum"])
def test_without_a_right_check_sum_nothing_is_believed(fault: Fault) -> None:
    samples, outbox = fixes(fault)
    assert samples == []
    assert outbox.counts == {"malformed:gnss": 50}


def test_rmc_is_used_where_there_is_no_gga() -> None:
    assert len(fixes("rmc_only")[0]) == len(fixes("empty_hdop")[0]) == 10


def test_the_first_position_is_the_origin_and_is_said_and_remembered() -> None:
    outbox, kept = Outbox(), list[GeoPoint]()
    local = LocalFixes("gnss", outbox, None, lambda it: kept.append(it.origin))
    driver = GnssDriver(Settings(), local, outbox, READ)
    (fix,) = driver.heard([epoch(SeenMotion(), 1.0, 0, TRONDHEIM)], 100 * S)
    assert (fix.north, fix.east) == (0.0, 0.0)
    assert len(kept) == outbox.counts["origin:gnss"] == 1
    assert "63.42" in outbox.said[-1][1]


def test_a_position_on_the_other_side_of_the_earth_is_none() -> None:
    outbox = Outbox()
    driver = driver_of(outbox)
    assert driver.heard([summed("GPGGA,1,0000.00,N,00000.00,E,1,9,1.0,0,M,0,M,,")], S) == []
    assert driver.heard([epoch(SeenMotion(), 1.0, 0, (0.0, 10.0))], 2 * S) == []
    assert outbox.counts["implausible:gnss"] == 2


@given(st.text("GNRMCA,.0123456789-NSEWV", max_size=60))
def test_no_sentence_with_a_right_check_sum_ends_it(body: str) -> None:
    driver_of(Outbox()).heard([summed(f"GNGGA,{body}"), summed(f"GPRMC,{body}")], S)
