"""A link that is cut, in the whole chain on virtual time. What the drone does without a pilot, and
what gives it back: test_fault_matrix.py, and services/reference/failsafe."""

from messages import topics
from messages.pilot import PilotCommand, PilotRequest
from tests.support.dive import ON_BOARD, Dive


class PersonsDive(Dive):
    """The chain, and a person topside who armed it and holds centred sticks."""

    def __init__(self) -> None:
        super().__init__(services=(*ON_BOARD, "tether", "link_monitor"))
        pilot, self.there, self.reason = self.host.node("gamepad", ["topside"]), True, ""
        sticks, self._ask = (
            pilot.publisher(topics.PILOT_COMMAND), pilot.publisher(topics.PILOT_REQUEST)
        )  # fmt: skip

        def speak(now: int) -> None:
            if self.there:
                sticks.put(PilotCommand(stamp_ns=now, surge=0.0, sway=0.0, heave=0.0, yaw=0.0))

        pilot.every(topics.PILOT_COMMAND.hz, speak)
        pilot.each(topics.PILOT_ANSWER, lambda m, _: setattr(self, "reason", m.reason))
        self.run(6.0)
        assert self.ask("arm") == ""

    def ask(self, kind: str) -> str:
        """Why the drone refuses; empty: it does not."""
        request = PilotRequest(stamp_ns=self.host.now, id=f"{kind}-{self.host.now}", kind=kind)  # type: ignore[arg-type]
        self._ask.put(request)
        self.run(0.3)
        return self.reason


def test_a_link_that_is_cut_is_told_from_a_pilot_who_is_silent() -> None:
    dive = PersonsDive()
    dive.host.kill("tether")
    dive.run(0.6)
    assert dive.statuses[-1].conditions == ("pilot_lost",)
    dive.run(1.0)
    assert dive.statuses[-1].conditions == ("link_lost", "pilot_lost")
    assert dive.statuses[-1].failsafe == "link_lost"
    dive.there = False
    dive.start("tether")
    dive.run(1.0)
    assert dive.statuses[-1].conditions == ("pilot_lost",)
    assert dive.statuses[-1].failsafe == "pilot_lost"  # the link is there again, he is not
    assert dive.ask("resume") == "pilot lost: no stick positions arrive, still"
