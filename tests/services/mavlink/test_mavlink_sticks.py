"""Sticks in packets, and which ground station has them."""

import math
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from messages.pilot import TTL_MS
from services.mavlink.sticks import Channels, StickPacket, lets_go, manual_control
from services.mavlink_io.packet import NO_AXIS, NO_CHANNEL, GroundStation
from services.piloting.guest_pilot import KEPT_NS, StickHolder
from services.piloting.sticks import CENTRED, Sticks

MS = 1_000_000
NEUTRAL = {"x": 0, "y": 0, "z": 500, "r": 0}
ANN, BOB = GroundStation("udp a", 255, 190), GroundStation("tcp b", 255, 190)
MOST = {"surge": ("x", 1000), "sway": ("y", 1000), "heave": ("z", 0), "yaw": ("r", 1000)}
CHANNELS = {"surge": (5, 1900), "sway": (6, 1900), "heave": (3, 1100), "yaw": (4, 1900)}
DOWN = Sticks(heave=1.0)


def rc_override(fields: dict[str, Any]) -> StickPacket | None:
    return Channels().hear(fields, 0)


def override(**channels: int) -> dict[str, Any]:
    return {f"chan{n}_raw": channels.get(f"ch{n}", NO_CHANNEL) for n in range(1, 19)}


@pytest.mark.parametrize("axis", MOST)
def test_a_full_stick_is_the_gain_on_its_axis_alone(axis: str) -> None:
    field, full = MOST[axis]
    sticks = manual_control(NEUTRAL | {field: full}, 0.5).sticks
    assert sticks == CENTRED._replace(**{axis: 0.5})
    channel, full = CHANNELS[axis]
    said = rc_override(override(**{f"ch{channel}": full}))
    assert said is not None
    assert said.sticks == CENTRED._replace(**{axis: 1.0})


def test_neutral_is_centred_and_an_axis_that_is_not_there_too() -> None:
    assert manual_control(NEUTRAL, 1.0).sticks == CENTRED
    assert manual_control(dict.fromkeys(NEUTRAL, NO_AXIS), 1.0).sticks == CENTRED


@given(st.integers(-32768, 32767), st.sampled_from("xyzr"), st.floats(0.0, 1.0))
def test_no_number_moves_more_than_a_full_stick(raw: int, field: str, gain: float) -> None:
    said = manual_control(NEUTRAL | {field: raw}, gain)
    assert all(abs(stick) <= gain for stick in said.sticks)


@given(st.lists(st.integers(0, 65535), min_size=18, max_size=18))
def test_no_channels_move_more_than_a_full_stick(raw: list[int]) -> None:
    fields = {f"chan{n + 1}_raw": us for n, us in enumerate(raw)}
    if (said := rc_override(fields)) is not None:
        assert all(abs(stick) <= 1.0 for stick in said.sticks)
        assert said.light is None or 0.0 <= said.light <= 1.0


@pytest.mark.parametrize("unsaid", [0, NO_CHANNEL])
def test_channels_that_are_not_said_are_centred(unsaid: int) -> None:
    said = rc_override(override(ch3=unsaid, ch5=1700))
    assert said is not None
    assert (said.sticks.heave, said.clipped) == (0.0, False)
    nothing = dict.fromkeys(override(), unsaid)
    assert rc_override(nothing) is None
    assert lets_go(nothing) == (unsaid == 0)


def test_one_channel_at_a_time_is_all_of_them() -> None:
    """As in the example of ArduSub's documentation: 65535 in all others."""
    channels, said = Channels(), None
    for k in range(40):
        number, us = ((3, 1300), (5, 1700), (4, 1900))[k % 3]
        said = channels.hear(override(**{f"ch{number}": us}), 50 * k * MS)
    assert said is not None
    assert said.sticks.heave > 0.4
    assert said.sticks.surge > 0.4
    assert said.sticks.yaw == 1.0
    later = 40 * 50 * MS
    said = channels.hear(override(ch5=0), later)  # released
    assert said is not None
    assert (said.sticks.surge, said.sticks.yaw) == (0.0, 1.0)
    said = channels.hear(override(ch6=1500), later + round(TTL_MS * MS))
    assert said is not None
    assert said.sticks == CENTRED  # all others are too old


def test_lights_and_tilt_have_channels() -> None:
    said = rc_override(override(ch8=1900, ch9=1500))
    assert said is not None
    assert (said.sticks, said.light) == (Sticks(tilt=1.0), 0.5)


def test_sticks_are_lost_with_their_time_to_live() -> None:
    holder = StickHolder[GroundStation]()
    assert not holder.reading(0).present
    assert holder.take(ANN, CENTRED, 0)
    last = round(TTL_MS * MS)
    assert holder.reading(last).present
    assert holder.reading(last).age_ms == TTL_MS
    assert not holder.reading(last + 1).present
    assert not holder.reading(last + 1).at_rest  # so nobody arms


def test_a_second_ground_station_gets_the_sticks_after_a_long_silence_only() -> None:
    holder = StickHolder[GroundStation]()
    assert holder.take(ANN, CENTRED, 0)
    assert not holder.take(BOB, DOWN, KEPT_NS - 1)
    assert holder.take(BOB, DOWN, KEPT_NS)
    assert not holder.take(ANN, CENTRED, KEPT_NS + 1)


def test_a_holder_that_lets_go_leaves_the_sticks_to_anybody() -> None:
    holder = StickHolder[GroundStation]()
    holder.take(ANN, CENTRED, 0)
    holder.release()
    assert not holder.reading(1).present
    assert holder.take(BOB, CENTRED, 1)


def test_sticks_that_were_deflected_when_taken_move_nothing_until_they_were_centred() -> None:
    holder = StickHolder[GroundStation]()
    for now in (0, MS):
        holder.take(ANN, DOWN, now)
        reading = holder.reading(now)
        assert (reading.sticks, reading.at_rest) == (CENTRED, False)
    holder.take(ANN, CENTRED, 2 * MS)
    holder.take(ANN, DOWN, 3 * MS)
    assert holder.reading(3 * MS).sticks == DOWN


@given(st.lists(st.tuples(st.sampled_from([ANN, BOB]), st.integers(1, 12_000)), max_size=40))
def test_at_every_instant_one_ground_station_has_the_sticks(
    packets: list[tuple[GroundStation, int]],
) -> None:
    holder, now = StickHolder[GroundStation](), 0
    for station, wait_ms in packets:
        before, silent = holder.sender, holder.age_ns(now + wait_ms * MS)
        now += wait_ms * MS
        taken = holder.take(station, DOWN, now)
        assert taken == (holder.sender == station)
        if before not in (None, holder.sender):
            assert silent >= KEPT_NS
        assert math.isfinite(holder.reading(now).age_ms)
