"""How long a dive is kept running."""

from collections.abc import Callable
from typing import cast

import pytest

from messages.vehicle import VehicleStatus
from services.runtime.launch.local_stack import LocalStack
from tools.live.dive_timeline import DiveTimeline
from tools.live.session import keep_running
from tools.live.stop_signals import StopSignals


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
