"""From thruster commands to the sticks that give their thrust."""

from messages import events
from messages.control import ThrusterCommand
from messages.pilot import PilotRequest
from messages.units import Ns, Outputs
from messages.vehicle import Actuation
from services.ardusub.mixer import NEUTRAL, Mixer, at_rest
from services.ardusub.outbox import DriverOutbox
from services.ardusub.settings import Settings
from services.marine.vehicle import Vehicle
from services.mavlink_io.numbers import AUTOPILOT, NO_CHANNEL
from services.mavlink_io.packet import MavlinkPacket
from services.vehicle.actuation import OpenLoopThrust
from services.vehicle.actuator_gate import ActuatorGate


class ThrustPath:
    """What is permitted, the sticks for it, and the thrust that the motors are believed to give."""

    def __init__(self, vehicle: Vehicle, settings: Settings, outbox: DriverOutbox) -> None:
        self._settings, self._outbox = settings, outbox
        self._gate = ActuatorGate(vehicle.thruster, outbox.events)
        self._believed = OpenLoopThrust(vehicle.thruster)
        self._rest = at_rest(len(vehicle.thruster))
        self.mixed = self._rest
        self._mixed_for: tuple[Mixer | None, tuple[float, ...]] | None = None
        self._driven = self._rest.thrust  # [N] as the motors were driven last
        self._light, self._tilt = 0.0, 0.0

    # Commands. Each returns whether to be armed is wished, or None where nobody says so.

    def obey(self, asked: ThrusterCommand, now: Ns) -> bool | None:
        self._gate.obey(asked, now)
        return self._gate.armed(now) if self._gate.command is asked else None

    def hear(self, request: PilotRequest, now: Ns) -> bool | None:
        """A disarm by the pilot."""
        self._gate.hear(request, now)
        commanded = self._gate.command is not None and self._gate.ends_ns is not None
        return self._gate.armed(now) if commanded else None

    def lapse(self, now: Ns) -> None:
        """The very instant after the last command has ended."""
        self._gate.lapse(now)

    @property
    def ends_ns(self) -> Ns | None:
        """[ns] Last instant of the command in force."""
        return self._gate.ends_ns

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
        thrust = self._gate.output(now)
        if (mixer, thrust) != self._mixed_for:
            self._mixed_for = mixer, thrust
            self.mixed = self._rest if mixer is None else mixer.mix(thrust)
            self._outbox.tell(events.SATURATED("mixer"), int(self.mixed.limited))
        driven = (self.mixed if spooled else self._rest).thrust
        if driven is not self._driven:
            self._driven = driven
            self._believed.drive(driven, now)

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
                "chan9_raw": light_pulse(self._light) if lights else 0,
            },
        )

    def actuation(self, now: Ns, power: float, outputs: Outputs) -> Actuation:
        """
        Args:
            power: [W] of the battery.
            outputs: [-] as driven now.
        """
        cause = self._gate.command
        return Actuation(
            stamp_ns=now,
            thrust=self._believed.believed(now),
            measured=False,
            actuated_ns=self._gate.obeyed_ns,
            sensor_ns=cause.sensor_ns if cause else None,
            pilot_ns=cause.pilot_ns if cause else None,
            stale=self._gate.ends_ns is None,
            power=power,
            outputs=outputs,
        )

    def gripper(self, now: Ns) -> float:
        """[-] As it may move now, + opens."""
        return self._gate.gripper(now)

    def _tilt_pulse(self) -> int:
        limit = self._settings.tilt_range
        if limit is None:
            return NO_CHANNEL
        return round(NEUTRAL + 400.0 * max(-1.0, min(1.0, self._tilt / limit)))


def light_pulse(share: float) -> int:
    """[µs] For a brightness 0 … 1."""
    return round(1100 + 800 * max(0.0, min(1.0, share)))
