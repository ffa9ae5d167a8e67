"""A message that is lost is lost once, however many services miss it."""

from collections import Counter
from collections.abc import Mapping
from pathlib import Path

import msgspec
from hypothesis import given
from hypothesis import strategies as st

from messages import events
from tests.support import said
from tools.analysis.losses import NOT_CARRIED, NOT_USED, losses
from tools.health_sums import HealthSums
from tools.recordings.recording import open_recording
from tools.report.report import Extras, make_report
from tools.report.summary import summary

FATES = {row.name for row in (events.LOST, *NOT_CARRIED, *NOT_USED)} - {events.OVERFLOWED.name}
STATE = "state"  # goes up
COMMAND = "pilot/command"  # goes down


HOMES = {"control": "drone", "reference": "drone", "ardusub": "drone"}


def seen(sides: Mapping[str, str] = HOMES, **by_service: dict[str, int]) -> dict[str, int]:
    """The losses of services by these names; home is topside where `sides` does not say it."""
    health = {name: HealthSums() for name in by_service}
    for name, sums in health.items():
        side = sides.get(name, "topside")
        sums.add(said.health(name, stamp_ns=1, sent=1, counts=by_service[name], side=side))
    return dict(losses(health))


@given(
    thinned=st.integers(0, 100),
    burst=st.integers(0, 100),
    damaged=st.integers(0, 20),
    elsewhere=st.integers(0, 20),
)
def test_what_the_link_counts_is_not_counted_by_those_who_miss_it(
    thinned: int, burst: int, damaged: int, elsewhere: int
):
    gaps = thinned + burst + damaged + elsewhere
    missing = {f"lost:{STATE}": gaps, f"malformed:{STATE}": damaged}
    link = {f"thinned:{STATE}": thinned, f"burst:{STATE}": burst, f"damaged:{STATE}": damaged}
    found = seen(tether=link, sounder=missing, visualizer=missing)
    assert found.get(f"lost:{STATE}", 0) == elsewhere
    assert f"malformed:{STATE}" not in found
    assert sum(found.values()) == gaps


def test_a_gap_on_board_is_not_explained_by_the_link():
    found = seen(tether={f"burst:{STATE}": 50}, control={f"lost:{STATE}": 3})
    assert found == {f"burst:{STATE}": 50, f"lost:{STATE}": 3}


@given(
    lost=st.integers(1, 100),
    service=st.sampled_from(["ardusub", "my_driver", "reference", "link_monitor_drone"]),
    key=st.sampled_from(["pilot/request", "pilot/command", "clock/ping"]),
)
def test_a_loss_on_the_way_down_is_counted_once_whatever_the_service_on_board_is_called(
    lost: int, service: str, key: str
):
    link = {f"burst:{key}": lost}
    found = seen({service: "drone"}, tether=link, **{service: {f"lost:{key}": lost}})
    assert found == link


def test_a_ping_is_missed_at_the_far_end_by_a_service_whose_home_is_the_near_one():
    link = {"burst:clock/ping": 8, "damaged:clock/ping": 1}
    missing = {"lost:clock/ping": 9, "malformed:clock/ping": 1}
    assert seen(tether=link, link_monitor=missing) == link


@given(st.lists(st.integers(0, 20), min_size=3, max_size=3), st.integers(0, 60))
def test_the_link_counts_a_family_under_one_name(gaps: list[int], counted: int):
    members = ("control", "estimation", "reference")
    missing = {f"lost:health/{name}": gap for name, gap in zip(members, gaps, strict=True)}
    found = seen(tether={"burst:health/*": counted}, supervisor=missing)
    rest = sum(count for name, count in found.items() if name.startswith("lost:"))
    assert rest == max(0, sum(gaps) - counted)


def test_what_a_service_had_and_did_not_use_leaves_no_second_trace():
    counts = {f"lost:{COMMAND}": 9, f"expired:{COMMAND}": 4, f"overflowed:{COMMAND}": 3}
    assert seen(reference=counts)[f"lost:{COMMAND}"] == 2


def test_of_those_who_missed_the_same_messages_the_one_that_missed_most_is_believed():
    few, many = {f"lost:{STATE}": 2}, {f"lost:{STATE}": 7}
    assert seen(control=few, reference=many) == many


def test_what_happens_to_each_service_by_itself_is_added_up():
    assert seen(control={"stale:state": 2}, reference={"stale:state": 3}) == {"stale:state": 5}


def test_no_more_is_lost_over_a_bad_link_than_was_sent(severe_dive: Path):
    recording = open_recording(severe_dive)
    sent: dict[str, int] = {}
    for entry in recording:
        sent[entry.key] = max(sent.get(entry.key, 0), entry.message.seq + 1)
    lost: Counter[str] = Counter()
    for name, count in make_report(recording, Extras()).losses.items():
        kind, _, key = name.partition(":")
        if kind in FATES:
            lost[key] += count
    assert lost["control/thrusters"] > 100
    for key in ("control/thrusters", "state", "reference", "pilot/command", "clock/ping"):
        assert lost[key] <= sent[key]


def test_a_dive_in_which_a_failsafe_acted_does_not_end_cleanly(severe_dive: Path):
    report = make_report(open_recording(severe_dive), Extras())
    times = report.losses["failsafe:pilot_lost"]
    first, second, *rest = summary(report).splitlines()
    assert first.endswith(f"ended; pilot lost {times} times" if times > 1 else "pilot lost once")
    sentence = events.PILOT_LOST.sentence
    line = f"{times} × {sentence}; the drone came to rest and held, first at "
    assert second.split(maxsplit=1)[1].startswith(line)
    assert {reaction.condition for reaction in report.failsafes} == {"pilot_lost"}
    assert {reaction.reaction for reaction in report.failsafes} == {"stop"}
    assert not any("failsafe" in line for line in rest)


def test_failsafes_are_never_pushed_out_and_what_is_left_out_is_the_least_important(
    severe_dive: Path,
):
    report = make_report(open_recording(severe_dive), Extras())
    counts = dict.fromkeys(("thinned:state", "burst:state", "lost:state", "loss:state"), 99_999)
    counts |= {"failsafe:state_lost": 1, "failsafe:pilot_lost": 1, "empty:battery": 1}
    counts |= {"lost:depth": 1, "saturated:port": 500}
    text = summary(msgspec.structs.replace(report, losses=counts))
    for words in (
        "drone's state lost",
        "pilot lost",
        events.EMPTY.sentence,
        events.LOST_DEPTH.sentence,
    ):
        assert words in text
    assert "reached its limit" in text
    assert "and 3 more kinds" in text
    whole = summary(msgspec.structs.replace(report, losses=counts), all_losses=True)
    assert " more kinds" not in whole
    assert len(whole.splitlines()) == len(text.splitlines()) + 2
