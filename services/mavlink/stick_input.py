"""MANUAL_CONTROL and RC_CHANNELS_OVERRIDE of the ground station that has the sticks."""

from dataclasses import dataclass, field

from messages import events
from messages.units import Ns
from messages.vehicle import VehicleStatus
from services.mavlink.buttons import ButtonReader
from services.mavlink.ground_pilot import GroundPilot
from services.mavlink.packets import GroundStation, ReceivedPacket
from services.mavlink.reaction import Reaction
from services.mavlink.stick_packets import Channels, StickPacket, lets_go, manual_control
from services.mavlink_io.numbers import MavSeverity
from services.piloting.pilot import Waiting

SAME_TEXT_NS = 5_000_000_000  # [ns] between two warnings that another one has the sticks


@dataclass(slots=True)
class StickInput:
    pilot: GroundPilot
    buttons: ButtonReader
    status: VehicleStatus | None = None  # newest of the drone
    _channels: Channels = field(default_factory=Channels)  # of who has the sticks
    _lamp: float | None = None  # [-] as RC channel 9 last said
    _warned_ns: Ns | None = None

    def manual_control(
        self, packet: ReceivedPacket, waiting: Waiting, now: Ns, out: Reaction
    ) -> None:
        holder, gain = self.pilot.holder, self.buttons.gain
        down = int(packet.fields["buttons"]) | int(packet.fields.get("buttons2") or 0) << 16
        if packet.sender != holder.sender:
            self.buttons.forget(down)
            self._channels = Channels()
        said = manual_control(packet.fields, gain)
        tilted = said.sticks._replace(tilt=self._channels.tilt(now))
        said = said._replace(sticks=tilted)
        if not self._steer(packet.sender, said, waiting, now, out):
            return
        armed = self.status is not None and self.status.armed
        outputs = {} if self.status is None else self.status.outputs
        pressed = self.buttons.read(down, armed=armed, light=self._light, outputs=outputs)
        holder.tilt, holder.gripper = pressed.tilt, pressed.gripper
        self.pilot.press(pressed.intents, waiting, now, out)
        if pressed.gain != gain:
            out.say(None, MavSeverity.INFO, f"#Gain is {100 * pressed.gain:.0f}%")
        if pressed.light is not None and "light" not in waiting:
            self.pilot.light(pressed.light, out)

    def rc_override(self, packet: ReceivedPacket, waiting: Waiting, now: Ns, out: Reaction) -> None:
        holder = self.pilot.holder
        has_them = packet.sender == holder.sender
        if not has_them:
            self._channels = Channels()
        said = self._channels.hear(packet.fields, now)
        if has_them and lets_go(packet.fields):
            holder.release()
            return
        if said is None:
            return
        if said.moves or not (has_them and holder.fresh(now)):
            if not self._steer(packet.sender, said, waiting, now, out):
                return
            holder.tilt = holder.gripper = 0.0
        if said.light is not None and said.light != self._lamp and "light" not in waiting:
            self._lamp = said.light
            self.pilot.light(said.light, out)

    @property
    def _light(self) -> float:
        """[-] 0 … 1"""
        return 0.0 if self.status is None else max(0.0, self.status.light)

    def _steer(
        self, station: GroundStation, said: StickPacket, waiting: Waiting, now: Ns, out: Reaction
    ) -> bool:
        if said.clipped:
            self.pilot.pilot.outbox.tell(events.CLAMPED("sticks"))
        if self.pilot.steer(station, said.sticks, waiting, now, out):
            return True
        if self._warned_ns is None or now >= self._warned_ns + SAME_TEXT_NS:
            self._warned_ns = now
            text = f"{self.pilot.name} has the sticks: yours are not obeyed"
            out.say(station.link, MavSeverity.WARNING, text)
        return False
