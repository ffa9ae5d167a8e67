"""Spectra find the noise and the lines that were put in; what is odd about a sensor is said."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from msgspec.structs import replace

from messages import topics
from messages.sensors import DvlSample
from services.estimation.core import AID_SOURCES
from services.marine.mounting import Mounting
from services.vehicle.mounting import AtOrigin
from tools.review.estimated import MEANS, in_words
from tools.review.recorded import NewerSamples, SensorColumns
from tools.review.sensors import SensorSection, vibration

RATE = 100.0


def imu(
    density: float,
    *,
    shaken: float = 1.0,
    line: float = 0.0,
    seconds: float = 60.0,
    hz: float = RATE,
) -> SensorColumns:
    """White noise of a density [unit/√Hz] on every axis, `shaken` times as much in the last third,
    with a line of that amplitude at 17 Hz on sway."""
    t = np.arange(round(seconds * hz)) / hz
    noise = np.random.default_rng(1).standard_normal((len(t), 6)) * density * np.sqrt(hz / 2.0)
    late = t > seconds * 2.0 / 3.0
    noise[late] *= shaken
    noise[:, 4] += np.where(late, line * np.sin(2.0 * np.pi * 17.0 * t), 0.0)
    noise[:, 5] -= 9.81
    return SensorColumns(t, t, noise, 0)


@given(density=st.floats(1e-4, 1.0), shaken=st.floats(3.0, 50.0))
def test_quiet_and_shaken_are_told_apart(density: float, shaken: float) -> None:
    found = vibration(imu(density, shaken=shaken))
    assert not isinstance(found, str)
    for axis in found.axes:
        assert axis.quiet_density == pytest.approx(density, rel=0.2)
        assert axis.shaken_density == pytest.approx(density * shaken, rel=0.2)


def test_a_line_is_found_and_is_no_noise() -> None:
    found = vibration(imu(0.01, shaken=2.0, line=1.0))
    assert not isinstance(found, str)
    by_name = {axis.name: axis for axis in found.axes}
    assert by_name["accelerometer sway"].peak_hz == pytest.approx(17.0, abs=0.5)
    assert by_name["accelerometer sway"].shaken_density == pytest.approx(0.02, rel=0.25)
    assert by_name["accelerometer surge"].peak_hz is None


def test_a_gap_is_not_drawn_over() -> None:
    whole = imu(0.01)
    keep = (whole.stamp % 2.0 > 0.3) | (whole.stamp < 30.0)
    holed = SensorColumns(whole.stamp[keep], whole.arrival[keep], whole.values[keep], 0)
    found, all_of_it = vibration(holed), vibration(whole)
    assert not isinstance(found, str)
    assert not isinstance(all_of_it, str)
    assert found.windows < all_of_it.windows
    assert found.axes[0].shaken_density == pytest.approx(0.01, rel=0.2)


@pytest.mark.parametrize(
    ("columns", "words"),
    [
        (imu(0.01, hz=2.0, seconds=300.0), "2 samples a second"),
        (imu(0.01, seconds=4.0), "without a gap"),
        (imu(0.01, seconds=0.3), "30 samples"),
    ],
)
def test_what_is_missing_is_said(columns: SensorColumns, words: str) -> None:
    found = vibration(columns)
    assert isinstance(found, str)
    assert words in found


@pytest.mark.parametrize(
    ("hz", "words"),
    [(2.0, "fast motion is missed"), (45.0, "fast motion is missed"), (55.0, ""), (100.0, ""),
     (190.0, ""), (400.0, "takes longer")],
)  # fmt: skip
def test_a_rate_is_odd_beyond_a_factor_of_two(hz: float, words: str) -> None:
    t = np.arange(200) / hz
    imu = SensorColumns(t, t, np.random.default_rng(4).standard_normal((len(t), 6)), 0)
    (stream,) = SensorSection({topics.IMU.key: imu}).streams
    assert len(stream.remarks) == bool(words)
    assert words in "".join(stream.remarks)


def test_what_no_owner_knows_is_explained() -> None:
    assert set(MEANS) < {name.partition("_")[0] for name in AID_SOURCES}
    assert in_words("hull_north") == "hull north (level acceleration by thrust and drag)"
    assert in_words("dvl_surge") == "dvl surge"


def test_values_that_come_again_are_said_as_an_import_says_them() -> None:
    again = DvlSample(stamp_ns=4, velocity=(0.1, 0.0, 0.0), std=0.01)
    samples = [replace(again, stamp_ns=1, velocity=None), replace(again, stamp_ns=3), again]
    newer = NewerSamples(AtOrigin(Mounting(), 1000.0), 0)
    assert [newer(sample) for sample in (*samples, again)] == [(0,), (0,), (1,), (None,)]
