"""The pilot's state machine: arming, releasing, losing the pilot, and never a step."""

from hypothesis import given, settings
from hypothesis import strategies as st

from messages.message import Estimate
from messages.pilot import PilotCommand, PilotRequest
from messages.reference import Reference
from messages.state import VehicleState
from services.reference.core import Pilotage, Settings

DT = 10_000_000  # [ns]
stick = st.floats(-1.0, 1.0)


def state(now: int, depth: float = 1.0, heading: float = 0.0, phase: str = "running"):
    return VehicleState(
        stamp_ns=now,
        sensor_ns=now,
        phase="running" if phase == "running" else "calibrating",
        depth=Estimate(depth, 0.01),
        depth_rate=Estimate(0.0, 0.01),
        depth_acceleration=Estimate(0.0, 0.01),
        attitude=(1.0, 0.0, 0.0, 0.0),
        roll=Estimate(0.0, 0.01),
        pitch=Estimate(0.0, 0.01),
        heading=Estimate(heading, 0.01),
        heading_navigation=None,
        yaw_rate=Estimate(0.0, 0.01),
    )


def sticks(now: int, heave: float = 0.0, yaw: float = 0.0, surge: float = 0.0, sway: float = 0.0):
    return PilotCommand(stamp_ns=now, surge=surge, sway=sway, heave=heave, yaw=yaw)


class Flight:
    """An ideal drone that is always where the reference wants it."""

    def __init__(self) -> None:
        self.pilotage = Pilotage(Settings())
        self.now = 0
        self.depth, self.heading = 1.0, 0.0
        self.flown: list[Reference] = []
        self.asked = 0

    def ask(self, kind: str, **more: float) -> str:
        self.asked += 1
        request = PilotRequest(stamp_ns=self.now, id=f"{self.asked}", kind=kind, **more)  # type: ignore[arg-type]
        answer, _ = self.pilotage.answer(request, sticks(self.now), self.now)
        return answer.reason

    def fly(self, seconds: float, command: PilotCommand | None) -> Reference:
        for _ in range(round(seconds * 100)):
            self.now += DT
            out = self.pilotage.step(state(self.now, self.depth, self.heading), command, self.now)
            assert out is not None
            if out.armed:
                self.depth, self.heading = out.depth.position, out.heading.position
            self.flown.append(out)
        return self.flown[-1]


def armed() -> Flight:
    flight = Flight()
    flight.fly(0.1, sticks(0))
    assert flight.ask("arm") == ""
    flight.fly(0.1, sticks(0))
    return flight


def test_it_does_not_arm_before_the_estimator_is_ready() -> None:
    flight = Flight()
    flight.pilotage.step(state(DT, phase="calibrating"), sticks(DT), DT)
    assert "does not know its depth" in flight.ask("arm")
    assert flight.pilotage.mode == "starting"


def test_it_does_not_arm_with_a_deflected_stick() -> None:
    flight = Flight()
    flight.fly(0.1, sticks(0))
    request = PilotRequest(stamp_ns=0, id="1", kind="arm")
    answer, changed = flight.pilotage.answer(request, sticks(0, heave=0.5), 0)
    assert not answer.accepted
    assert "not centred" in answer.reason
    assert not changed


def test_disarmed_the_reference_follows_the_vehicle_so_that_arming_has_no_jump() -> None:
    flight = Flight()
    flight.depth = 3.0
    assert flight.fly(0.1, sticks(0, heave=1.0)).depth.position == 3.0
    flight.ask("arm")
    assert flight.fly(0.5, sticks(0)).depth.position == 3.0


def test_a_released_stick_stops_where_the_closed_form_says() -> None:
    flight, heave = armed(), Settings().heave
    flight.fly(4.0, sticks(0, heave=1.0))
    cruising = flight.flown[-1].depth
    end = flight.fly(4.0, sticks(0)).depth
    # From v at a = 0 with a_max: ramp, cruise and fade take v T / 2 (Andrén 2023, 5.2.5).
    total = heave.max_velocity / heave.max_acceleration + 4 * heave.max_acceleration / (
        3 * heave.jerk
    )
    assert cruising.velocity == heave.max_velocity
    expected = cruising.position + heave.max_velocity * total / 2 + heave.max_velocity * DT * 1e-9
    assert abs(end.position - expected) < 1e-9
    assert end.velocity == end.acceleration == 0.0


@settings(max_examples=40, deadline=None)
@given(st.lists(st.tuples(stick, stick, stick, stick, st.floats(0.02, 1.0)), max_size=6))
def test_no_stick_can_make_a_step_in_velocity_or_acceleration(
    moves: list[tuple[float, float, float, float, float]],
) -> None:
    flight, s = armed(), Settings()
    for surge, sway, heave, yaw, seconds in moves:
        flight.fly(seconds, sticks(0, heave, yaw, surge, sway))
    for before, after in zip(flight.flown, flight.flown[1:], strict=False):
        for a, b, axis in (
            (before.depth, after.depth, s.heave),
            (before.heading, after.heading, s.yaw),
        ):
            assert abs(b.acceleration - a.acceleration) <= axis.jerk * DT * 1e-9 + 1e-9
            assert abs(b.velocity - a.velocity) <= axis.max_acceleration * DT * 1e-9 + 1e-9
            assert abs(b.jerk) <= axis.jerk * (1 + 1e-9)
        rate = s.surge.max_rate * DT * 1e-9 + 1e-9
        assert abs(after.surge_force - before.surge_force) <= rate
        assert abs(after.sway_force - before.sway_force) <= rate


def test_a_lost_pilot_means_a_smooth_stop_and_hold_and_is_counted_once() -> None:
    flight = armed()
    flight.fly(3.0, sticks(0, heave=1.0, surge=1.0))
    end = flight.fly(5.0, None)
    later = flight.fly(1.0, None)
    assert end.depth.velocity == end.surge_force == 0.0
    assert later.depth.position == end.depth.position
    assert flight.pilotage.happened == ["failsafe:pilot_lost"]
    assert flight.pilotage.status(None, 0).failsafe == "pilot_lost"


def test_an_unplugged_pad_is_a_lost_pilot_although_its_sticks_read_zero() -> None:
    flight = armed()
    lost = PilotCommand(stamp_ns=0, surge=0, sway=0, heave=0, yaw=0, pilot="lost")
    flight.fly(0.1, lost)
    assert flight.pilotage.status(lost, 0).failsafe == "pilot_lost"


def test_stop_ignores_the_sticks_until_they_were_centred() -> None:
    flight = armed()
    flight.fly(2.0, sticks(0, heave=1.0))
    flight.ask("stop")
    assert flight.fly(4.0, sticks(0, heave=1.0)).depth.velocity == 0.0
    assert flight.pilotage.mode == "stopping"
    flight.fly(0.1, sticks(0))
    assert flight.fly(3.0, sticks(0, heave=1.0)).depth.velocity == Settings().heave.max_velocity


def test_held_back_by_the_floor_the_reference_waits() -> None:
    flight, s = armed(), Settings()
    pilotage, now = flight.pilotage, flight.now
    for _ in range(1000):
        now += DT
        out = pilotage.step(state(now, depth=1.0), sticks(0, heave=1.0), now)
        assert out is not None
        assert out.depth.position <= 1.0 + s.heave.max_error + 1e-9
    assert pilotage.happened.count("clamped:reference.depth") == 1


def test_without_a_state_it_stops_smoothly_and_keeps_its_rate() -> None:
    flight = armed()
    flight.fly(3.0, sticks(0, heave=1.0))
    before = flight.flown[-1].depth
    outs: list[Reference] = []
    for _ in range(500):
        flight.now += DT
        out = flight.pilotage.step(None, sticks(0, heave=1.0), flight.now)
        assert out is not None
        outs.append(out)
    assert abs(outs[0].depth.velocity - before.velocity) < 0.01
    assert outs[-1].depth.velocity == 0.0
    assert outs[-1].sensor_ns is None
    assert flight.pilotage.status(None, 0).failsafe == "state_lost"


def test_light_wants_a_brightness() -> None:
    flight = armed()
    assert "brightness" in flight.ask("light")
    assert flight.ask("light", value=0.7) == ""
    assert flight.pilotage.status(None, 0).light == 0.7


def test_a_repeated_request_is_answered_again_but_done_once() -> None:
    flight = armed()
    stop = PilotRequest(stamp_ns=flight.now, id="stop-7", kind="stop")
    first, changed = flight.pilotage.answer(stop, sticks(0), flight.now)
    assert changed
    flight.fly(0.1, sticks(0))  # centred: the stop is over
    again, changed = flight.pilotage.answer(stop, sticks(0), flight.now)
    assert again.accepted == first.accepted
    assert not changed
    assert flight.pilotage.mode == "piloted"
