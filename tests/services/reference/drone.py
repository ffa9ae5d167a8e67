"""A drone with its reference generator, as the tests of this room fly it."""

from collections.abc import Sequence
from itertools import pairwise
from typing import Any, Self

from msgspec import UNSET

from messages.events import Outbox
from messages.pilot import PilotAnswer, PilotCommand, PilotRequest, RequestKind
from messages.reference import Reference
from messages.sensors import LeakSample
from messages.state import VehicleState
from messages.vehicle import VehicleStatus
from services.reference.core import GuidanceCheckpoint, ReferenceGenerator, Settings
from services.reference.failsafe.table import WatchedMessages
from tests.support import said

DT = 10_000_000  # [ns] of a step
ROUNDING = 1e-9


def smooth(flown: Sequence[Reference], s: Settings, *, stops: bool = False) -> None:
    """No step in position, velocity or acceleration of depth and heading, and none in the pace;
    jerk and acceleration within the limits of the axis, or of a stop."""
    step = DT * 1e-9
    for before, after in pairwise(flown):
        for a, b, axis in (
            (before.depth, after.depth, s.heave),
            (before.heading, after.heading, s.yaw),
        ):
            most = axis.stop if stops else axis.limits
            mean = (a.velocity + b.velocity) / 2
            assert abs(b.position - a.position - mean * step) <= most.jerk * step**3 + ROUNDING
            assert abs(b.velocity - a.velocity) <= most.acceleration * step + ROUNDING
            assert abs(b.acceleration - a.acceleration) <= most.jerk * step + 1e-6
            assert abs(b.acceleration) <= most.acceleration * (1 + ROUNDING) + ROUNDING
            assert abs(b.jerk) <= most.jerk * (1 + ROUNDING)
        paces = (r.surge.velocity if r.surge else 0.0 for r in (before, after))
        first, second = paces
        assert abs(second - first) <= s.place.stop_acceleration * step + ROUNDING


class Drone:
    """It is always where the reference wants it. Its commands pass the lease, as in the service."""

    def __init__(
        self,
        settings: Settings | None = None,
        before: GuidanceCheckpoint | None = None,
        *,
        depth: float = 1.0,
        place: tuple[float, float] | None = None,
    ) -> None:
        memory = before or GuidanceCheckpoint()
        self.generator = ReferenceGenerator(settings or Settings(), Outbox(), memory)
        self.now: int = 0  # [ns]
        self.asked, self.epoch = 0, 0
        self.depth, self.heading, self.place = depth, 0.0, place
        self.flown: list[Reference] = []
        self.leaks = False

    def armed(self) -> Self:
        self.fly(0.1)
        assert self.ask("arm") == ""
        self.fly(0.1)
        return self

    def ask(self, kind: RequestKind, command: PilotCommand | None = None, **more: Any) -> str:
        """Why a request is refused; empty: it is granted."""
        return self.request(kind, command, **more).reason

    def request(
        self, kind: RequestKind, command: PilotCommand | None = None, **more: Any
    ) -> PilotAnswer:
        self.asked += 1
        sent: dict[str, Any] = {"epoch": self.epoch} | more
        request = PilotRequest(stamp_ns=self.now, id=f"{self.asked}", kind=kind, **sent)
        answer = self.generator.answer(request, command or self.sticks(), self.now)
        self.epoch = self.epoch if answer.epoch is None else answer.epoch
        return answer

    def sticks(self, **axes: Any) -> PilotCommand:
        return said.sticks(self.now, epoch=self.epoch, **axes)

    def state(self) -> VehicleState | None:
        north, east = self.place or (None, None)
        still = None if self.place is None else 0.0
        return said.state(
            self.now, depth=self.depth, heading=self.heading, north=north, east=east,
            surge_velocity=still, sway_velocity=still, origin=UNSET if self.place is None else 1,
        )  # fmt: skip

    def measured(self) -> WatchedMessages:
        """What its other sensors say at this step."""
        return WatchedMessages(leak=LeakSample(stamp_ns=0, wet=self.leaks))

    def fly(self, seconds: float, *, there: str = "pilot", **axes: Any) -> Reference:
        """With these sticks. `there`: pilot, nobody, no state, or leak beside the pilot."""
        self.leaks = there == "leak"
        for _ in range(round(seconds * 1e9 / DT)):
            self.now += DT
            self.generator.conditions.newest = self.measured()
            command = None if there == "no pilot" else self.sticks(**axes)
            self.step(None if there == "no state" else self.state(), command)
        return self.flown[-1]

    def step(self, state: VehicleState | None, command: PilotCommand | None) -> None:
        authority = self.generator.authority
        if command is not None and not authority.admits(command.epoch, self.now):
            command = None
        if command is not None:
            authority.heard(command.epoch, self.now)
        out = self.generator.step(state, command, self.now)
        assert out is not None
        self.flown.append(out)
        if out.armed:
            self.depth, self.heading = out.depth.position, out.heading.position
        if out.north is not None and out.east is not None:
            self.place = out.north.position, out.east.position

    @property
    def status(self) -> VehicleStatus:
        return self.generator.status(self.now)
