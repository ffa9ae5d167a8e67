"""However control changes hands, the reference has no step: every axis is continuous in position,
velocity and acceleration, and its jerk stays within its limit."""

from itertools import pairwise

from hypothesis import example, given, settings
from hypothesis import strategies as st

from messages.events import Outbox
from messages.pilot import PilotCommand, PilotRequest, RequestKind
from messages.reference import Motion, Reference
from services.reference.core import ReferenceGenerator, Settings
from tests.support.said import state

DT = 0.01  # [s]
NS = 10_000_000  # [ns] DT
KINDS: tuple[RequestKind, ...] = ("lease", "force", "offer", "release")
Event = tuple[str, RequestKind, float, float, float]  # who, asks what, heave, yaw, surge of both
STICK = st.floats(-1.0, 1.0)
EVENT = st.tuples(st.sampled_from(["ann", "bob"]), st.sampled_from(KINDS), STICK, STICK, STICK)


class TwoPilots:
    """Wired as in the service; both always speak, each with sticks of its own."""

    def __init__(self) -> None:
        self.generator = ReferenceGenerator(Settings(), Outbox())
        self.epochs = {"ann": 0, "bob": 0}
        self.sticks = {"ann": (0.0, 0.0, 0.0), "bob": (0.0, 0.0, 0.0)}
        self.now = 0  # [ns]
        self.flown: list[Reference] = []
        self._state = state(0, depth=1.0)
        self._command: PilotCommand | None = None

    def ask(self, who: str, kind: RequestKind) -> bool:
        request = PilotRequest(
            stamp_ns=self.now, id=f"{who}-{self.now}-{kind}", kind=kind, source=who,
            epoch=self.epochs[who],
        )  # fmt: skip
        answer = self.generator.answer(request, self._command, self.now)
        if answer.epoch is not None:
            self.epochs[who] = answer.epoch
        return answer.accepted

    def fly(self, steps: int) -> None:
        authority = self.generator.authority
        for _ in range(steps):
            self.now += NS
            for who, (heave, yaw, surge) in self.sticks.items():
                if authority.admits(self.epochs[who], self.now):
                    authority.heard(self.epochs[who], self.now)
                    self._command = PilotCommand(
                        stamp_ns=self.now, heave=heave, yaw=yaw, surge=surge, sway=0.0, source=who
                    )
            out = self.generator.step(self._state, self._command, self.now)
            assert out is not None
            self._state = state(self.now, depth=out.depth.position, heading=out.heading.position)
            self.flown.append(out)


@settings(max_examples=40, deadline=None)
@example([("ann", "lease", 1.0, 0.0, 0.0), ("bob", "force", -1.0, 1.0, 1.0)])
@given(st.lists(EVENT, min_size=2, max_size=6))
def test_no_hand_over_steps_in_any_derivative(events: list[Event]) -> None:
    sea = TwoPilots()
    sea.fly(5)
    assert sea.ask("ann", "lease")
    sea.fly(5)
    assert sea.ask("ann", "arm")
    for who, kind, *sticks in events:
        heave, yaw, surge = sticks
        sea.sticks[who] = (heave, yaw, surge)
        sea.ask(who, kind)
        sea.fly(60)
    pairs = list(pairwise(sea.flown))
    for before, after in pairs:
        if before.armed and after.armed:
            assert_continuous(before.depth, after.depth)
            assert_continuous(before.heading, after.heading)
    steps = [abs(after.surge_force - before.surge_force) for before, after in pairs]
    assert max(steps) <= Settings().horizontal.max_rate * DT * 1.001
    if {kind for _, kind, *_ in events} == {"force"}:
        assert len({reference.epoch for reference in sea.flown}) > 1


def assert_continuous(before: Motion, after: Motion) -> None:
    """Between two samples the motion changes by no more than a limited jerk can change it."""
    assert before.jerk_limit is not None
    assert after.jerk_limit is not None
    jerk = max(before.jerk_limit, after.jerk_limit) * 1.001
    p, v, a = before.position, before.velocity, before.acceleration
    assert abs(after.acceleration - a) <= jerk * DT + 1e-9
    assert abs(after.velocity - v - a * DT) <= jerk * DT**2 / 2 + 1e-9
    assert abs(after.position - p - v * DT - a * DT**2 / 2) <= jerk * DT**3 / 6 + 1e-9
