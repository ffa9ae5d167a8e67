"""The table of streams: its own laws, and that everything sent survives the wire."""

import math
import re

import msgspec
import pytest

from messages import topics
from messages.pilot import PilotCommand
from messages.topic import Direction


def test_every_key_is_lower_case_chunks_and_unique() -> None:
    keys = [topic.key for topic in topics.ALL]
    assert len(keys) == len(set(keys))
    for key in keys:
        assert re.fullmatch(r"[a-z0-9_]+(/[a-z0-9_]+)*(/\*)?", key)


def test_every_message_type_says_when_it_was_true() -> None:
    for topic in topics.ALL:
        assert {"seq", "stamp_ns"} <= set(topic.message.__struct_fields__)


def test_a_family_covers_its_members_and_nothing_below_them() -> None:
    assert topics.HEALTH.covers("health/control")
    assert not topics.HEALTH.covers("health/control/deep")
    assert not topics.HEALTH.covers("health")
    assert topics.HEALTH.of("control").key == "health/control"
    assert topics.find("health/anything") is topics.HEALTH
    assert topics.find("nobody/knows") is None


def test_a_stream_is_news_for_five_periods_and_at_least_a_tenth_of_a_second() -> None:
    for topic in topics.ALL:
        limit = round(max(5e9 / topic.hz, 1e8)) if topic.hz else None
        assert topic.stale_after_ns == limit, topic.key


@pytest.mark.parametrize("bad", [math.nan, math.inf, -math.inf, 1.0001, -1.0001])
def test_a_stick_outside_its_range_is_not_decoded(bad: float) -> None:
    command = PilotCommand(stamp_ns=0, surge=bad, sway=0.0, heave=0.0, yaw=0.0)
    payload = msgspec.msgpack.encode(command)
    with pytest.raises(msgspec.ValidationError, match="surge"):
        msgspec.msgpack.decode(payload, type=PilotCommand)


def test_commands_never_stay_in_force_longer_than_a_third_of_a_second() -> None:
    command = PilotCommand(stamp_ns=0, surge=0.0, sway=0.0, heave=0.0, yaw=0.0)
    assert 0 < command.ttl_ms <= 333


def test_raw_sensors_never_cross_the_tether() -> None:
    raw = (topics.IMU, topics.MAGNETOMETER, topics.PRESSURE)
    assert all(topic.way is Direction.STAY for topic in raw)
