"""The outputs of the vehicle as the pilot wants them: what keeps its value, and what is held."""

from collections.abc import Mapping

from messages.pilot import PilotCommand, PilotRequest
from messages.units import Ns, Outputs
from services.marine.outputs import LIGHT, Output, gripper_of, refusal


class PilotOutputs:
    """The laws:

    1. A dimmer or switch has the value of the newest request that was granted.
    2. One with `off_after` is off while the drone is disarmed, and goes off once there has been no
       pilot for so long. It stays off until it is asked for again.
    3. A gripper moves only while fresh commands of a present pilot say so, and the drone is armed
       and obeys the sticks. After any gap it moves again once it was let go: a button that was
       held through a loss moves nothing.
    """

    def __init__(self, outputs: tuple[Output, ...], values: Mapping[str, float], now: Ns) -> None:
        """`values`: of dimmers and switches, from a checkpoint."""
        self._outputs = outputs
        self._values = {o.name: values.get(o.name, 0.0) for o in outputs if o.kind != "gripper"}
        self._asked_ns = dict[str, Ns]()  # stamp of the newest request that was granted
        self._pilot_ns = now  # when a pilot was there last
        self._gripper_of = gripper_of(outputs)
        self._let_go = False  # the gripper, since it last obeyed nobody
        self.gripper = 0.0  # [-] now

    @property
    def values(self) -> Outputs:
        """Of dimmers and switches, by name."""
        return dict(self._values)

    @property
    def all(self) -> Outputs:
        """Of every output, by name."""
        held = {} if self._gripper_of is None else {self._gripper_of.name: self.gripper}
        return self._values | held

    @property
    def light(self) -> float:
        return self._values.get(LIGHT, 0.0)

    def set(self, request: PilotRequest, now: Ns, *, armed: bool) -> str:
        """A request of kind output or light. Returns why it is refused, or nothing."""
        name = LIGHT if request.kind == "light" else request.output
        if reason := refusal(self._outputs, name, request.value, armed=armed):
            return reason
        asked_ns = min(request.stamp_ns, now)
        if asked_ns < self._asked_ns.get(name, asked_ns):
            return f"a newer request has set {name}"
        self._asked_ns[name] = asked_ns
        self._values[name] = request.value or 0.0
        return ""

    def disarm(self) -> None:
        """What is on only while the drone is armed goes off, and the gripper stands still."""
        self._values |= {o.name: 0.0 for o in self._outputs if o.off_after is not None}
        self.gripper, self._let_go = 0.0, False

    def step(self, command: PilotCommand | None, now: Ns, *, armed: bool, free: bool) -> None:
        """
        Args:
            command: the newest fresh one.
            free: the drone obeys the sticks.
        """
        present = command is not None and command.pilot == "present"
        if present:
            self._pilot_ns = now
        if not armed:
            self.disarm()
        for output in self._outputs:
            if output.off_after is not None and now - self._pilot_ns > output.off_after * 1e9:
                self._values[output.name] = 0.0
        asked = command.gripper if command is not None and present and free else None
        self._let_go = asked is not None and (self._let_go or asked == 0.0)
        obeys = self._let_go and self._gripper_of is not None
        self.gripper = asked if obeys and asked is not None else 0.0
