"""What goes to the board: sticks that give the thrust of a command, and the vehicle's outputs as
its servo outputs, by DO_SET_SERVO.

The board keeps a servo's pulse until it gets another one, and its acknowledgement does not say
which servo it is about: so one is under way at a time, and each is repeated until it is
acknowledged. A gripper waits for none: it has to stand still at once."""

from messages import events
from messages.control import ThrusterCommand
from messages.pilot import PilotRequest
from messages.units import Ns, Outputs
from messages.vehicle import Actuation
from services.ardusub.mixing import NEUTRAL, Mixer, at_rest
from services.ardusub.settings import DriverOutbox, Settings
from services.marine.outputs import LIGHT, Output
from services.marine.vehicle import Vehicle
from services.mavlink_io.packet import (
    AUTOPILOT,
    NO_CHANNEL,
    MavCommand,
    MavlinkPacket,
    MavResult,
    command,
)
from services.vehicle.actuation import OpenLoopThrust
from services.vehicle.actuator_gate import ActuatorGate


class ThrustPath:
    """What is permitted, the sticks for it, and the thrust that a model of the motors gives."""

    def __init__(self, vehicle: Vehicle, settings: Settings, outbox: DriverOutbox) -> None:
        self._settings, self._outbox = settings, outbox
        self.gate = ActuatorGate(vehicle.thruster, outbox.events)
        self._modelled = OpenLoopThrust(vehicle.thruster)
        self._rest = at_rest(len(vehicle.thruster))
        self.mixed = self._rest
        self._mixed_for: tuple[Mixer | None, tuple[float, ...]] | None = None
        self._driven = self._rest.thrust  # [N] as the motors were driven last
        self._light, self._tilt = 0.0, 0.0

    # Commands. Each returns whether the vehicle should be armed; None: it does not say.

    def obey(self, asked: ThrusterCommand, now: Ns) -> bool | None:
        self.gate.obey(asked, now)
        return self.gate.armed(now) if self.gate.command is asked else None

    def hear(self, request: PilotRequest, now: Ns) -> bool | None:
        """A disarm by the pilot."""
        self.gate.hear(request, now)
        commanded = self.gate.command is not None and self.gate.ends_ns is not None
        return self.gate.armed(now) if commanded else None

    def show(self, light: float, tilt: float) -> None:
        """Brightness 0 … 1 and camera tilt [rad], upwards."""
        self._light, self._tilt = light, tilt

    # What follows.

    def rest(self) -> None:
        self.mixed, self._mixed_for = self._rest, None

    def mix(self, mixer: Mixer | None, now: Ns, *, spooled: bool) -> None:
        """
        Args:
            mixer: of the board; None where it must rest.
            spooled: the motors follow the sticks by now.
        """
        thrust = self.gate.output(now)
        if (mixer, thrust) != self._mixed_for:
            self._mixed_for = mixer, thrust
            self.mixed = self._rest if mixer is None else mixer.mix(thrust)
            self._outbox.tell(events.SATURATED("mixer"), int(self.mixed.limited))
        driven = (self.mixed if spooled else self._rest).thrust
        if driven is not self._driven:
            self._driven = driven
            self._modelled.drive(driven, now)

    def sticks(self, *, lights: bool) -> MavlinkPacket:
        """All six axes, every time: a channel that is left out would keep its last value.

        Args:
            lights: this version has a channel for them.
        """
        pulses = {f"chan{n}_raw": pulse for n, pulse in enumerate(self.mixed.pulses, 1)}
        return MavlinkPacket(
            "RC_CHANNELS_OVERRIDE",
            {
                "target_system": self._settings.board,
                "target_component": AUTOPILOT,
                **pulses,
                "chan7_raw": NO_CHANNEL,
                "chan8_raw": self._tilt_pulse(),
                "chan9_raw": round(1100 + 800 * max(0.0, min(1.0, self._light))) if lights else 0,
            },
        )

    def actuation(self, now: Ns, power: float, outputs: Outputs) -> Actuation:
        """
        Args:
            power: [W] of the battery.
            outputs: [-] as driven now.
        """
        cause = self.gate.command
        return Actuation(
            stamp_ns=now,
            thrust=self._modelled.believed(now),
            measured=False,
            actuated_ns=self.gate.obeyed_ns,
            sensor_ns=cause.sensor_ns if cause else None,
            pilot_ns=cause.pilot_ns if cause else None,
            stale=self.gate.ends_ns is None,
            power=power,
            outputs=outputs,
        )

    def _tilt_pulse(self) -> int:
        limit = self._settings.tilt_range
        if limit is None:
            return NO_CHANNEL
        return round(NEUTRAL + 400.0 * max(-1.0, min(1.0, self._tilt / limit)))


AGAIN_NS = 300_000_000  # [ns] before one without an answer is repeated
REFUSED_NS = 2_000_000_000  # [ns] before one that was refused is
TRIES = 3  # without an answer, before it is said


def servos_of(outputs: tuple[Output, ...]) -> dict[str, int]:
    """Number of the servo output of each output that has one."""
    return {output.name: output.servo for output in outputs if output.servo is not None}


class BoardServos:
    def __init__(
        self, outputs: tuple[Output, ...], settings: Settings, outbox: DriverOutbox
    ) -> None:
        self._board, self._outbox = settings.board, outbox
        self._servos = {output: output.servo for output in outputs if output.servo is not None}
        self.forget()

    @property
    def names(self) -> dict[int, str]:
        """Names of the outputs, by the number of their servo."""
        return {number: output.name for output, number in self._servos.items()}

    def forget(self) -> None:
        """Another board, or the same one rebooted: nothing is known of its servos."""
        self._done = dict[Output, int]()  # [µs] as acknowledged
        self._sent = dict[Output, int]()  # [µs] newest
        self._not_before = dict[Output, Ns]()  # of one that was refused
        self._tries = 0
        self._pending: Output | None = None
        self._pending_ns: Ns = 0

    def due(self, values: Outputs, now: Ns, *, lights: bool) -> None:
        """Send what is due at `now` [ns].

        Args:
            values: [-] of the outputs, by name; of those that are left out nothing is known.
            lights: this version has a channel of its own for the light.
        """
        wanted = {
            output: output.pulse(values[output.name])
            for output in self._servos
            if output.name in values and not (lights and output.name == LIGHT)
        }
        for output, pulse in wanted.items():
            if output.kind == "gripper" and self._sent.get(output) != pulse:
                self._send(output, pulse, now)
                return
        if self._pending is not None:
            if now - self._pending_ns < AGAIN_NS:
                return
            self._tries += 1
            if self._tries == TRIES:
                self._outbox.tell(events.UNANSWERED_SERVO(detail=self._named(self._pending)))
            again = wanted.get(self._pending)
            if again is not None:
                self._send(self._pending, again, now)
                return
            self._pending = None
        for output, pulse in wanted.items():
            may = now >= self._not_before.get(output, now)
            if self._done.get(output) != pulse and may:
                self._tries = 0
                self._send(output, pulse, now)
                return

    def rest(self, now: Ns) -> None:
        """The service ends in order: the gripper stands still."""
        for output in self._servos:
            if output.kind == "gripper":
                self._send(output, output.pulse(0.0), now)

    def acknowledged(self, result: int, now: Ns) -> None:
        """The board's answer to a DO_SET_SERVO."""
        output, self._pending = self._pending, None
        if output is None:
            return  # of somebody else
        self._tries = 0
        if result == MavResult.ACCEPTED:
            self._done[output] = self._sent[output]
            self._outbox.may_repeat(events.REFUSED_SERVO())
            self._outbox.may_repeat(events.UNANSWERED_SERVO())
            return
        self._done.pop(output, None)
        self._not_before[output] = now + REFUSED_NS
        detail = (
            f"{self._named(output)}, with result {result}: SERVO{self._servos[output]}_FUNCTION "
            f"must leave it free, as 0 does"
        )
        self._outbox.tell(events.REFUSED_SERVO(detail=detail))

    def _send(self, output: Output, pulse: int, now: Ns) -> None:
        if self._pending not in (None, output):
            self._done.pop(self._pending, None)  # its answer may be taken for that of this one
        self._pending, self._pending_ns, self._sent[output] = output, now, pulse
        number = self._servos[output]
        self._outbox.send(command(self._board, MavCommand.DO_SET_SERVO, number, pulse))

    def _named(self, output: Output) -> str:
        return f"{output.name}, servo {self._servos[output]}"
