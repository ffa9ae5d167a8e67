"""What each of two machines says at the end of a dive of what the other one has."""

from pathlib import Path

from hypothesis import given
from hypothesis import strategies as st
from msgspec.structs import replace

from messages.health import Health
from tools.health_sums import HealthOfAll
from tools.recordings.recording import Recording
from tools.report.report import Extras, make_report
from tools.report.summary import Elsewhere, elsewhere, restarted, unrecorded

TOPSIDE = ("gamepad", "visualizer", "link_monitor", "predictor")
PROCESSES = st.sampled_from(["gamepad", "link_monitor", "predictor", "hub_topside"])


def health(service: str) -> Health:
    return Health(
        stamp_ns=1, service=service, loop_hz=1.0, lateness_p50_ms=None, lateness_p99_ms=None,
        cpu_percent=None, rss_mb=None, sent=1, received=1, counts={},
    )  # fmt: skip


@given(heard=st.sets(st.sampled_from(TOPSIDE), min_size=1))
def test_services_of_the_other_machine_that_nobody_heard_are_named(heard: set[str]):
    sums = HealthOfAll()
    for name in sorted(heard):
        sums.add(health(name))
    report = make_report(Recording([]), Extras(health=sums.sums))
    said = elsewhere(report, Elsewhere("topside", TOPSIDE))
    assert "\n" not in said
    assert said.startswith("elsewhere ")
    assert "not known here: stick to thruster, sensor to screen and the clock offset" in said
    _, _, silent = said.partition("; never heard: ")
    assert {name for name in TOPSIDE if name in silent} == set(TOPSIDE) - heard


def test_a_machine_that_was_never_there_is_said_in_one_sentence():
    said = elsewhere(make_report(Recording([]), Extras()), Elsewhere("topside", TOPSIDE))
    assert (
        said.split(maxsplit=1)[1] == "the topside was never heard: nothing of it is in this report"
    )


def test_a_topside_that_comes_after_another_is_no_restart_of_its_services():
    sums = HealthOfAll()
    for instance in (1, 2, 3):
        names = ("gamepad", "recorder_topside", "supervisor_topside")[: 2 if instance == 3 else 3]
        for name in names:
            sums.add(replace(health(name), side="topside", instance=instance))
        sums.add(replace(health("control"), side="drone", instance=instance))
    report = make_report(Recording([]), Extras(health=sums.sums))
    found = {name: service.restarts for name, service in report.services.items()}
    assert found == {"control": 2, "gamepad": 1, "recorder_topside": 1, "supervisor_topside": 0}


def test_services_of_one_process_are_one_restart():
    restarts = {"estimation": 2, "control": 2, "recorder": 1, "gamepad": 0, "hub_drone": 0}
    shared = {"estimation": "onboard", "control": "onboard", "gamepad": "topside"}
    assert restarted(restarts, shared) == ["onboard (control, estimation) 2 ×", "recorder 1 ×"]
    text = unrecorded("topside of pioneer", restarts, [], "drone", [], shared)
    assert "restarted         onboard (control, estimation) 2 × and recorder 1 ×" in text


@given(
    restarts=st.dictionaries(PROCESSES, st.integers(0, 99)),
    gone=st.lists(PROCESSES, unique=True),
    files=st.sampled_from([[], [Path("out/dive.rrd")]]),
)
def test_the_side_without_recorder_names_every_restart_and_every_loss(
    restarts: dict[str, int], gone: list[str], files: list[Path]
):
    text = unrecorded("topside of pioneer, ended cleanly", restarts, gone, "drone", files)
    lines = dict(line.split(maxsplit=1) for line in text.splitlines())
    labels = ["Dive", "restarted", "services", "recorded"]
    assert list(lines) == [*labels, *(["written"] if files else [])]
    again = {name: count for name, count in restarts.items() if count}
    for name, count in again.items():
        assert f"{name} {count} ×" in lines["restarted"]
    assert lines["restarted"].count("×") == len(again)
    assert (lines["restarted"] == "nothing") == (not again)
    assert all(name in lines["services"] for name in gone)
    assert (lines["services"] == "all alive at the end") == (not gone)
    assert "recording and report.json are on the drone" in lines["recorded"]


def test_what_two_topsides_counted_is_not_counted_again_and_again():
    """They report by turns under the same names; neither was restarted."""
    ann, bob, said = 11, 22, health("gamepad")
    reports = [
        replace(said, stamp_ns=k, instance=who, sent=10 * k + who, counts={"stale:x": n})
        for k in range(5)
        for who, n in ((ann, 1), (bob, 2))
    ]
    sums = HealthOfAll()
    for report in reports:
        sums.add(report)
    assert {name: one.counts for name, one in sums.sums.items()} == {"gamepad": {"stale:x": 3}}
    assert sums.sums["gamepad"].restarts == 0
    later = [replace(one, instance=33, stamp_ns=9) for one in reports if one.instance == ann]
    for report in later:
        sums.add(report)
    assert sums.sums["gamepad"].restarts == 1
