"""The table of events, and the outbox that events leave a core by."""

import re

import pytest

from messages import events
from messages.events import ALL, CONDITIONS, Outbox, Severity, known, row_of, sentence, short


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
