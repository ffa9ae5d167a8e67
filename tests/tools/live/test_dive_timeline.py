"""When a dive is over, how long it is kept running, and where its page is."""

import socket
from collections.abc import Callable
from typing import cast

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from messages.message import Notice
from messages.vehicle import VehicleStatus
from services.runtime.config.errors import LindyError
from services.runtime.config.stack import Stack
from services.runtime.launch.local_stack import LocalStack
from tools.live.cockpit import announce
from tools.live.dive_timeline import ARMING_S, PATIENCE_S, DiveTimeline
from tools.live.session import keep_running
from tools.live.stop_signals import StopSignals

LENGTHS = st.floats(0.5, 600.0)
WAITS = st.floats(0.0, 0.9 * ARMING_S)


def ns(seconds: float) -> int:
    return round(seconds * 1e9)


def status(armed: bool, *codes: str) -> VehicleStatus:
    return VehicleStatus(
        stamp_ns=0,
        activity="piloted" if armed else "starting",
        armed=armed,
        notices=tuple(map(Notice, codes)),
    )


def armed_after(timeline: DiveTimeline, wait_s: float) -> DiveTimeline:
    timeline.see(status(armed=False), 0)
    assert timeline.over(ns(wait_s)) is None
    timeline.see(status(armed=True), ns(wait_s))
    return timeline


@settings(max_examples=50, deadline=None)
@given(LENGTHS, WAITS)
def test_a_script_is_over_when_it_has_ended_and_the_drone_is_disarmed(length: float, wait: float):
    timeline = armed_after(DiveTimeline(script_s=length), wait)
    end = ns(wait + length)
    assert timeline.over(end) is None
    timeline.see(status(armed=False), end)
    assert timeline.over(end) == "clean"


def test_a_disarmed_moment_in_mid_script_is_not_the_end():
    timeline = armed_after(DiveTimeline(script_s=60.0), 3.0)
    timeline.see(status(armed=False), ns(20))
    assert timeline.over(ns(20)) is None


@settings(max_examples=50, deadline=None)
@given(LENGTHS, LENGTHS, WAITS)
def test_seconds_count_from_arming_and_end_any_dive(script: float, seconds: float, wait: float):
    timeline = armed_after(DiveTimeline(script_s=script + seconds, seconds=seconds), wait)
    assert timeline.over(ns(wait + seconds) - 1000) is None
    assert timeline.over(ns(wait + seconds) + 1000) == "clean"
    assert timeline.length_s == seconds


def test_a_drone_that_never_disarms_does_not_hold_the_dive_for_ever():
    timeline = armed_after(DiveTimeline(script_s=10.0), 0.0)
    reason = timeline.over(ns(10.0 + PATIENCE_S))
    assert reason is not None
    assert reason != "clean"


def test_a_script_that_waits_too_long_for_arming_ends_with_the_drones_own_reason():
    timeline = DiveTimeline(script_s=10.0)
    timeline.see(status(False, "calibrating"), 0)
    with pytest.raises(LindyError, match=r"did not arm .* keep the drone still"):
        timeline.over(ns(ARMING_S) + 1)


def test_what_crashed_is_named_before_what_it_left_undone():
    timeline = DiveTimeline(script_s=10.0, crashed=lambda: ["driver 10 ×"])
    timeline.see(status(False, "no_state"), 0)
    with pytest.raises(
        LindyError,
        match=r"30 s: started again: driver 10 ×, its lines say why; not ready: no usable",
    ):
        timeline.over(ns(ARMING_S) + 1)


def test_a_person_may_wait_for_arming_and_dive_as_long_as_wanted():
    timeline = DiveTimeline(script_s=None)
    assert timeline.over(ns(3600)) is None
    timeline.see(status(armed=True), ns(3600))
    assert timeline.over(ns(36000)) is None


def test_the_arming_by_another_sides_pilot_is_not_the_beginning_of_this_dive():
    timeline = DiveTimeline(script_s=10.0, in_control=lambda status: status.epoch == 2)
    theirs = VehicleStatus(stamp_ns=0, activity="piloted", armed=True, pilot="ann", epoch=1)
    timeline.see(theirs, ns(1))
    assert (timeline.armed, timeline.controlled, timeline.armed_ns) == (False, False, None)
    assert timeline.over(ns(ARMING_S + 1)) is None
    timeline.see(theirs, ns(10 * ARMING_S))
    assert timeline.over(ns(11 * ARMING_S)) is None  # a drone that somebody flies is waited for
    with pytest.raises(LindyError, match=r"did not arm within 30 s: ann has control"):
        timeline.over(ns(11 * ARMING_S + 1))
    ours = VehicleStatus(stamp_ns=0, activity="piloted", armed=True, pilot="bob", epoch=2)
    timeline.see(ours, ns(2))
    assert (timeline.armed, timeline.controlled, timeline.armed_ns) == (True, True, ns(2))


class NeverAllAlive:
    """A stack of which one service never comes: it waits as long as it is looked at."""

    looks = 0

    def start_services(self) -> None:
        pass

    def wait_alive(self, _: float, look: Callable[[], bool]) -> None:
        while look() and self.looks < 1000:
            self.looks += 1

    class stack:  # noqa: N801
        insecure = False


def test_a_dive_is_over_in_time_though_a_service_is_still_waited_for(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    now = 0

    def look() -> bool:
        nonlocal now
        now += 100_000_000
        if now == 1_000_000_000:
            timeline.see(VehicleStatus(stamp_ns=now, armed=True, activity="ready"), now)
        return True

    monkeypatch.setattr("time.monotonic_ns", lambda: now)
    timeline, local = DiveTimeline(None, 2.0), NeverAllAlive()
    with StopSignals() as stop:
        assert keep_running(cast(LocalStack, local), timeline, stop, look) == "clean"
    assert now == 3_000_000_000 + 100_000_000


def test_no_address_is_printed_of_a_port_that_is_taken(capsys: pytest.CaptureFixture[str]) -> None:
    with socket.create_server(("127.0.0.1", 0)) as taken:
        port = taken.getsockname()[1]
        stack = Stack(vehicle="pioneer", overrides=[f"cockpit.port={port}"])
        with pytest.raises(LindyError, match=rf"cannot listen on 127\.0\.0\.1:{port}"):
            announce(stack, browser=False)
    assert capsys.readouterr().out == ""
    announce(stack, browser=False)
    assert f"http://127.0.0.1:{port}/" in capsys.readouterr().out
