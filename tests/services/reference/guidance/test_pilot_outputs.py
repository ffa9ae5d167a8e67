"""Outputs as the pilot wants them: what keeps its value, and what ends with its commands."""

import pytest
from hypothesis import given
from hypothesis import strategies as st

from messages.events import Outbox
from messages.pilot import PilotCommand, PilotRequest
from services.marine.outputs import Output
from services.reference.core import GuidanceCheckpoint, ReferenceGenerator, Settings
from services.reference.guidance.requests import PilotOutputs
from tests.support.said import sticks

S = 1_000_000_000  # [ns]
STEP = 10_000_000  # [ns]
OUTPUTS = (
    Output("light", "dimmer"),
    Output("lasers", "switch", off_after=2.0),
    Output("jaw", "gripper"),
)


def command(now: int, gripper: float, *, present: bool = True) -> PilotCommand:
    return sticks(now, gripper=gripper, pilot="present" if present else "lost")


def asked(name: str, value: float | None, stamp_ns: int = 0) -> PilotRequest:
    return PilotRequest(stamp_ns=stamp_ns, id="1", kind="output", output=name, value=value)


class Drone:
    def __init__(self) -> None:
        self.outputs, self.now = PilotOutputs(OUTPUTS, {}, 0), 0
        self.armed = True

    def step(self, gripper: float | None, *, present: bool = True, free: bool = True) -> float:
        """None: no fresh command."""
        self.now += STEP
        said = None if gripper is None else command(self.now, gripper, present=present)
        self.outputs.step(said, self.now, armed=self.armed, free=free and self.armed)
        return self.outputs.gripper

    def set(self, name: str, value: float | None) -> str:
        return self.outputs.set(asked(name, value, self.now), self.now, armed=self.armed)


MOSTLY = st.sampled_from([True, True, True, False])
situations = st.lists(
    st.tuples(
        # Gripper of a command; None: none is fresh.
        st.one_of(st.sampled_from([0.0, 1.0, -1.0]), st.floats(-1.0, 1.0), st.none()),
        MOSTLY,  # the pilot is present
        MOSTLY,  # the drone obeys the sticks
        MOSTLY,  # it is armed
    ),
    max_size=60,
)


@given(situations)
def test_a_gripper_moves_only_as_a_present_pilot_says_and_after_it_was_let_go(
    story: list[tuple[float | None, bool, bool, bool]],
) -> None:
    drone, let_go = Drone(), False
    for gripper, present, free, armed in story:
        drone.armed = armed
        moved = drone.step(gripper, present=present, free=free)
        obeyed = gripper is not None and present and free and armed
        let_go = obeyed and (let_go or gripper == 0.0)
        assert moved == (gripper if let_go else 0.0)


@given(situations)
def test_a_light_stays_whatever_happens_and_lasers_are_never_on_while_disarmed(
    story: list[tuple[float | None, bool, bool, bool]],
) -> None:
    drone = Drone()
    assert drone.set("light", 0.5) == ""
    for gripper, present, free, armed in story:
        drone.armed = armed
        drone.set("lasers", 1.0)
        drone.step(gripper, present=present, free=free)
        assert drone.outputs.values["light"] == 0.5
        assert armed or drone.outputs.values["lasers"] == 0.0


def test_lasers_go_off_when_the_pilot_has_been_gone_for_as_long_as_the_file_says() -> None:
    for gone in (None, 0.0):  # nothing arrives, or only that he is lost
        drone = Drone()
        drone.step(0.0)
        assert drone.set("lasers", 1.0) == ""
        began = drone.now
        while drone.outputs.values["lasers"]:
            assert drone.now < began + 3 * S
            drone.step(gone, present=False)
        assert drone.now == began + 2 * S + STEP
        drone.step(0.0)
        assert drone.outputs.values["lasers"] == 0.0  # and stay off


def test_what_cannot_be_is_refused_in_a_sentence() -> None:
    drone = Drone()
    assert drone.set("laser", 1.0) == (
        "this vehicle has no output 'laser'; there are: light, lasers, jaw"
    )
    assert "needs 0 (off) or 1 (on)" in drone.set("lasers", 0.5)
    assert "brightness between 0 and 1" in drone.set("light", -0.5)
    assert "brightness between 0 and 1" in drone.set("light", None)
    assert "while its button is held" in drone.set("jaw", 1.0)
    drone.armed = False
    assert drone.set("lasers", 1.0) == "lasers can be on only while the drone is armed"
    assert drone.set("lasers", 0.0) == ""
    assert drone.outputs.all == {"light": 0.0, "lasers": 0.0, "jaw": 0.0}


def test_a_request_that_was_overtaken_changes_nothing_and_one_of_the_future_locks_nothing() -> None:
    outputs = PilotOutputs(OUTPUTS, {}, 0)
    assert outputs.set(asked("light", 1.0, 5 * S), 5 * S, armed=True) == ""
    assert "newer" in outputs.set(asked("light", 0.0, 4 * S), 6 * S, armed=True)
    assert outputs.set(asked("lasers", 1.0, 4 * S), 6 * S, armed=True) == ""
    assert outputs.values == {"light": 1.0, "lasers": 1.0}
    assert outputs.set(asked("light", 1.0, 3600 * S), 6 * S, armed=True) == ""
    assert outputs.set(asked("light", 0.0, 7 * S), 7 * S, armed=True) == ""
    assert outputs.light == 0.0


@pytest.mark.parametrize("kind", ["light", "output"])
def test_light_is_the_output_of_this_name_and_outlives_a_restart(kind: str) -> None:
    first = ReferenceGenerator(Settings(), Outbox(), has=OUTPUTS)
    name = "" if kind == "light" else "light"
    request = PilotRequest(stamp_ns=0, id="1", kind=kind, value=0.25, output=name)  # type: ignore[arg-type]
    assert first.answer(request, None, 0).accepted
    assert first.status(0).light == 0.25
    assert first.checkpoint != GuidanceCheckpoint()
    second = ReferenceGenerator(Settings(), Outbox(), first.checkpoint, S, has=OUTPUTS)
    assert second.status(S).outputs == {"light": 0.25, "lasers": 0.0, "jaw": 0.0}


def test_lasers_go_off_too_where_no_state_of_the_drone_ever_arrives() -> None:
    before = GuidanceCheckpoint(armed=True, outputs={"light": 0.5, "lasers": 1.0})
    generator = ReferenceGenerator(Settings(), Outbox(), before, 0, has=OUTPUTS)
    for k in range(1, 202):
        assert generator.status(k * STEP).outputs["lasers"] == 1.0
        assert generator.step(None, None, k * STEP) is None
    assert generator.status(3 * S).outputs == {"light": 0.5, "lasers": 0.0, "jaw": 0.0}
