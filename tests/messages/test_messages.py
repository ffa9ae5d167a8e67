"""The tables of streams and of events, and the bounded numbers of messages and settings."""

import math
import re
from collections import defaultdict
from pathlib import Path

import msgspec
import pytest

from messages import events, topics, units
from messages.events import ALL, CONDITIONS, Outbox, Severity, known, row_of, sentence, short
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


# The table of events, and the outbox that events leave a core by.


def test_sentences_are_sentences_and_no_event_stands_in_two_rows() -> None:
    for row in ALL.values():
        assert re.search("[a-z] [a-z]", row.sentence), row
        assert not re.search("[_{}]", row.sentence), row
        assert re.fullmatch(r"[a-z_]+(:[a-z_./]+)?", row.name)
    with pytest.raises(AssertionError):
        events.row("frozen", Severity.SENSOR, "a sensor is frozen")


def test_a_failsafe_is_graver_than_anything_else() -> None:
    gravest = {row.name for row in ALL.values() if row.severity is Severity.FAILSAFE}
    assert gravest == {name for name in ALL if name.partition(":")[0] == "failsafe"}
    assert all(ALL[name].breaks == "piloted" for name in gravest)


def test_what_is_noticed_and_what_acts_have_one_sentence() -> None:
    for condition in CONDITIONS.values():
        assert condition.noticed.sentence == condition.acted.sentence == condition.sentence
        assert condition.noticed.to_do == condition.acted.to_do


def test_a_row_of_its_own_goes_before_that_of_its_kind() -> None:
    assert row_of("alarm:link") is events.ALARM_LINK
    assert row_of("alarm:leak") is events.ALARM
    assert events.STALE("pilot/command").row is events.STALE_COMMAND
    assert row_of("odd:thing").sentence == "odd"
    assert not known("odd:thing")
    assert known("frozen:sensor/dvl")


@pytest.mark.parametrize(
    ("name", "detail", "shown"),
    [
        ("failsafe:pilot_lost", "", "pilot lost: no stick positions arrive"),
        ("saturated:vertical", "", "a thruster reached its limit (vertical)"),
        ("notice:battery_low", "12 % left", "the battery is low: 12 % left"),
        ("odd:thing", "", "odd"),
    ],
)
def test_a_sentence_says_to_what_it_happened_where_the_row_does_not(
    name: str, detail: str, shown: str
) -> None:
    assert sentence(name, detail) == shown


def test_short_words() -> None:
    assert short("hung:control") == "control did not answer"
    assert short("failsafe:imu_lost") == "IMU lost"
    assert short("failsafe:too_deep") == "too deep"


def test_an_outbox_counts_all_and_says_what_the_row_says() -> None:
    outbox = Outbox()
    outbox.tell(events.RATE("sensor/dvl"), 3)
    outbox.tell(events.SILENT_PAD(detail="USB pad"))
    outbox.tell(None)
    outbox.tell(events.LOST("state"), 0)
    assert outbox.counts == {"rate:sensor/dvl": 3, "silent:pad": 1}
    assert [*outbox.said] == [
        ("warning", f"{events.SILENT_PAD.sentence}; USB pad", "silent:pad"),
    ]


def test_what_is_normal_in_any_dive_is_no_trouble() -> None:
    counts = {
        events.DROPPED("state").name: 3,
        "resting:gyro_bias": 90,
        "unready": 1,
        "mine": 2,
    }
    assert events.troubles(counts) == 5


# One name, one range.


ROOT = Path(__file__).parents[2]


NUMBER = re.compile(r"^(\w+) = Annotated\[|^(Vec3|Vec6|Quaternion) = ", re.MULTILINE)


def number_types() -> dict[str, list[str]]:
    """Every name that is given to a bounded number or to a vector, and the files that do so."""
    found: dict[str, list[str]] = defaultdict(list)
    for folder in ("messages", "services", "tools"):
        for file in sorted((ROOT / folder).rglob("*.py")):
            for match in NUMBER.finditer(file.read_text(encoding="utf-8")):
                found[match[1] or match[2]].append(str(file.relative_to(ROOT)))
    return found


def test_no_two_number_types_share_a_name() -> None:
    found = number_types()
    assert found["Positive"] == found["Vec3"] == ["messages/units.py"]
    assert {name: files for name, files in found.items() if len(files) > 1} == {}


@pytest.mark.parametrize(
    ("kind", "least", "below"),
    [
        (units.Positive, 1e-300, 0.0),
        (units.NotNegative, 0.0, -1e-300),
        (units.NotNegativeSetting, 0.0, -1e-300),
        (units.Share, 0.0, -1e-300),
        (units.OpenShare, 1e-300, 0.0),
    ],
)
def test_a_name_says_whether_nothing_is_allowed(kind: object, least: float, below: float) -> None:
    assert msgspec.convert(least, kind) == least
    with pytest.raises(msgspec.ValidationError):
        msgspec.convert(below, kind)
