"""Every row of the table of failsafes: when it begins, acts and ends; and what is said of services
that are late or silent."""

from dataclasses import dataclass
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from messages.control import Wrench
from messages.events import Outbox
from messages.health import LATE_MS, Health
from messages.pilot import PilotCommand, PilotRequest
from messages.sensors import AltitudeSample, BatterySample, DvlSample, LeakSample, TemperatureSample
from messages.state import VehicleState
from services.reference.core import ReferenceGenerator, Settings
from services.reference.failsafe.machine import FailsafeMachine, Holding
from services.reference.failsafe.table import (
    HEALTH_PATIENCE_NS,
    RECENT_NS,
    ConditionWatch,
    WatchedMessages,
    table,
)
from services.reference.settings import FailsafeSettings
from tests.support.messages import example
from tests.support.said import health, state, sticks

S = 1_000_000_000  # [ns]
WATCHED = {
    "estimation": "motion", "ardusub": "motion", "recorder": "recorder", "link_monitor": "clock",
}  # fmt: skip
SETTINGS = FailsafeSettings()
NAMES = tuple(row.name for row in table(SETTINGS))


WELL, CENTRED, NOTHING = state(20 * S, depth=2.0), sticks(20 * S), WatchedMessages()


@dataclass
class Now:
    """What is seen `at` [ns]; at first an armed drone of which nothing is wrong."""

    state: VehicleState | None = WELL
    command: PilotCommand | None = CENTRED
    armed: bool = True
    unheld: tuple[str, ...] = ()
    limited: bool = False
    above_floor: bool = False
    newest: WatchedMessages = NOTHING
    reports: tuple[tuple[float, Health], ...] = ()  # [s] when; health of services
    pinged: float | None = None  # [s]
    at: int = 20 * S

    def conditions(self) -> dict[str, Holding]:
        watch = ConditionWatch(SETTINGS, WATCHED)
        watch.newest = self.newest
        if self.pinged is not None:
            watch.ping(round(self.pinged * S))
        for second, report in self.reports:
            watch.health(report, round(second * S))
        watch.state, watch.command, watch.now = self.state, self.command, self.at
        watch.armed, watch.unheld = self.armed, self.unheld
        watch.limited, watch.above_floor = self.limited, self.above_floor
        return watch.holding()


def newest(**sample: Any) -> WatchedMessages:
    return WatchedMessages(**sample)


def wrench(seconds: float) -> WatchedMessages:
    return newest(wrench=example(Wrench, round(seconds * S)))


def battery(left: float) -> WatchedMessages:
    return newest(battery=example(BatterySample, used_wh=100.0 * (1.0 - left), capacity_wh=100.0))


def hot(celsius: float) -> WatchedMessages:
    return newest(temperature=TemperatureSample(stamp_ns=0, temperature=celsius))


def reports(service: str, *seconds: float, **counts: int) -> tuple[tuple[float, Health], ...]:
    """Of a service; what it counts comes with the last one."""
    *before, last = seconds
    return (*((at, health(service)) for at in before), (last, health(service, **counts)))


OK = health("estimation")
# Row → when it holds; when it does not (any more), by as little as the table promises.
ROWS: dict[str, tuple[Now, Now]] = {
    "leak": (
        Now(newest=newest(leak=LeakSample(stamp_ns=0, wet=True))),
        Now(newest=newest(leak=LeakSample(stamp_ns=0, wet=False))),
    ),
    "battery_critical": (Now(newest=battery(0.10)), Now(newest=battery(0.11))),
    "battery_low": (Now(newest=battery(0.25)), Now(newest=battery(0.26))),
    "state_lost": (Now(state=None), Now()),
    "imu_lost": (Now(state=state(invalid=("roll",))), Now()),
    "link_lost": (Now(command=None, pinged=18.9), Now(command=None, pinged=19.1)),
    "pilot_lost": (Now(command=None), Now(command=None, armed=False)),
    "depth_limit": (Now(limited=True), Now()),
    "too_deep": (Now(state=state(depth=100.6)), Now(state=state(depth=100.4))),
    "floor_limit": (Now(above_floor=True), Now()),
    "near_floor": (
        Now(newest=newest(altimeter=AltitudeSample(stamp_ns=0, altitude=0.49))),
        Now(newest=newest(altimeter=AltitudeSample(stamp_ns=0, altitude=0.51))),
    ),
    "depth_lost": (Now(unheld=("depth",)), Now()),
    "heading_lost": (Now(unheld=("heading",)), Now(unheld=("depth",))),
    "sensor": (Now(state=state(troubles=("silent:sensor/dvl",))), Now(state=state(troubles=()))),
    "control_silent": (Now(newest=wrench(19.4)), Now(newest=wrench(19.6))),
    "board_silent": (
        Now(reports=reports("ardusub", 17.0, 18.0, **{"silent:board": 1})),
        Now(reports=reports("ardusub", 16.0, 17.0, **{"silent:board": 1})),
    ),
    "service_silent": (
        Now(reports=reports("estimation", 16.0, 16.9)),
        Now(reports=reports("estimation", 16.0, 17.1)),
    ),
    "service_late": (
        Now(reports=((9.0, OK), (10.1, health("estimation", 41.0)), (19.0, OK))),
        Now(reports=((9.0, OK), (10.1, health("estimation", 40.0)), (19.0, OK))),
    ),
    "recorder_down": (
        Now(reports=reports("recorder", 16.9)), Now(reports=reports("recorder", 17.1)),
    ),
    "disk_full": (
        Now(reports=reports("recorder", 10.0, 10.1, disk_error=1)),
        Now(reports=reports("recorder", 9.0, 9.9, disk_error=1)),
    ),
    "clock_jump": (
        Now(reports=reports("link_monitor", 10.0, 10.1, **{"jumped:clock": 1})),
        Now(reports=reports("link_monitor", 9.0, 9.9, **{"jumped:clock": 1})),
    ),
    "too_hot": (Now(newest=hot(60.0)), Now(newest=hot(59.0))),
}  # fmt: skip


def test_every_row_of_the_table_is_here() -> None:
    assert set(ROWS) == set(NAMES)


@pytest.mark.parametrize("name", NAMES)
def test_it_begins_and_ends_where_the_table_says(name: str) -> None:
    bad, good = ROWS[name]
    assert name in bad.conditions()
    assert name not in good.conditions()


def test_conditions_are_told_in_the_order_of_the_table() -> None:
    bad = Now(
        None, None, unheld=("depth", "heading"), limited=True, above_floor=True, pinged=1.0,
        newest=newest(leak=LeakSample(stamp_ns=0, wet=True), battery=battery(0.1).battery,
                      temperature=hot(70.0).temperature, wrench=wrench(1.0).wrench),
        reports=(*reports("estimation", 1.0, 2.0), *reports("recorder", 1.0)),
    )  # fmt: skip
    found = [*bad.conditions()]
    assert len(found) > 10
    assert found == sorted(found, key=NAMES.index)


@pytest.mark.parametrize("name", NAMES)
def test_it_acts_in_its_stages_and_only_while_armed(name: str) -> None:
    row = next(row for row in table(SETTINGS) if row.name == name)
    for armed in (True, False):
        machine = FailsafeMachine(table(SETTINGS), Outbox())
        for second in range(70):
            machine.step({name: Holding()}, second * S, armed=armed, at_surface=False)
            begun = [stage.reaction for stage in row.stages if stage.after <= second]
            expected = begun[-1] if armed else "notice"
            acts = expected in ("stop", "ascend", "surface")
            assert machine.reaction == (expected if acts else None)
            assert machine.holding == (name,)


def test_the_near_floor_is_told_by_the_dvl_as_well_but_the_altimeter_goes_first() -> None:
    near = DvlSample(stamp_ns=0, velocity=None, std=0.01, altitude=0.3)
    far = AltitudeSample(stamp_ns=0, altitude=3.0)
    assert "near_floor" in Now(newest=newest(dvl=near)).conditions()
    assert "near_floor" not in Now(newest=newest(dvl=near, altimeter=far)).conditions()


def test_the_link_is_not_lost_while_commands_come() -> None:
    for command in (CENTRED, sticks(20 * S, pilot="lost")):
        assert "link_lost" not in Now(pinged=0.0, command=command).conditions()


def test_an_empty_battery_gets_worse() -> None:
    levels = [Now(newest=battery(left)).conditions()["battery_critical"].level
              for left in (0.10, 0.061, 0.059, 0.019)]  # fmt: skip
    assert levels == [0, 0, 1, 2]


@pytest.mark.parametrize("name", ["leak", "battery_critical"])
def test_an_ascent_goes_on_after_a_restart_until_its_sensor_says_that_it_ended(name: str) -> None:
    """The service starts anew in mid-dive, and the sensor has said nothing yet."""
    rising = ReferenceGenerator(Settings(), Outbox())

    def step(generator: ReferenceGenerator, now: int, seen: WatchedMessages) -> None:
        generator.conditions.newest = seen
        generator.step(state(now, depth=5.0), sticks(now), now)

    rising.armed = True
    for tenth in range(1, 120):
        step(rising, tenth * S // 10, ROWS[name][0].newest)
    assert rising.status(12 * S).reaction == "ascend"

    again = ReferenceGenerator(Settings(), Outbox(), rising.checkpoint, 12 * S)
    for tenth in range(1, 20):
        step(again, 12 * S + tenth * S // 10, WatchedMessages())
        status = again.status(12 * S)
        assert (status.reaction, status.resumable) == ("ascend", False)
    # Dry again, it rises on until the pilot acts: but now `resume` is granted.
    step(again, 15 * S, ROWS[name][1].newest)
    assert again.status(15 * S).resumable


SERVICES = {
    "my_driver": "motion", "control": "motion", "recorder": "recorder", "link_monitor": "clock",
    "supervisor_drone": "keeper",
}  # fmt: skip


@given(
    st.sampled_from([*SERVICES, "gamepad"]),
    st.lists(st.sampled_from([None, 0.0, LATE_MS, LATE_MS + 1.0, 500.0]), max_size=30),
)
def test_a_late_service_is_said_for_ten_seconds_but_not_for_its_first_report(
    service: str, reports: list[float | None]
) -> None:
    """Of those services alone that the motion depends on."""
    watch = ConditionWatch(FailsafeSettings(), SERVICES)
    for second, late_ms in enumerate(reports):
        watch.now = second * S
        watch.health(health(service, late_ms), watch.now)
        were = [
            ms is not None and ms > LATE_MS and k > 0 and (second - k) * S < RECENT_NS
            for k, ms in enumerate(reports[: second + 1])
        ]
        depends = SERVICES.get(service) == "motion"
        assert ("service_late" in watch.holding()) == (depends and any(were))


@given(st.sampled_from([*SERVICES, "gamepad"]), st.integers(0, 6 * S))
def test_a_service_that_falls_silent_is_said_by_its_role(service: str, silence_ns: int) -> None:
    watch = ConditionWatch(FailsafeSettings(), SERVICES)
    watch.health(health(service, 0.0), 0)
    watch.now, watch.armed = silence_ns, True
    found = watch.holding()
    long, role = silence_ns > HEALTH_PATIENCE_NS, SERVICES.get(service)
    assert ("service_silent" in found) == (long and role in ("motion", "keeper"))
    assert ("recorder_down" in found) == (long and role == "recorder")
    if "service_silent" in found:
        assert found["service_silent"].about == (service,)


@pytest.mark.parametrize("armed", [False, True])
def test_arming_is_refused_while_the_board_does_not_answer(armed: bool) -> None:
    generator = ReferenceGenerator(Settings(), Outbox(), watched=WATCHED)
    for second, silent in enumerate((0, 0, 1)):
        now = second * S
        generator.conditions.health(health("ardusub", **{"silent:board": silent}), now)
        generator.step(state(now, depth=2.0), sticks(now), now)
        generator.armed = armed
        words = generator.answer(PilotRequest(stamp_ns=now, id="1", kind="arm"), sticks(now), now)
        assert words.reason == ("the vehicle's board does not answer" if silent else "")
