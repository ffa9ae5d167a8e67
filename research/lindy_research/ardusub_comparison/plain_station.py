"""A ground station that only overrides channels, for ArduSub's own modes."""

import socket
import time

from lindy_research.ardusub_comparison.sticks import StickMove
from services.mavlink_io.io.endpoint import FrameReader, MavlinkCodec
from services.mavlink_io.packet import MavCommand, MavlinkPacket, MavModeFlag, command, heartbeat

ALT_HOLD = 2
# [-] of its full sticks, for the speeds that Lindy flies at its own: 1 m/s and 1.05 rad/s.
SURGE, YAW = 0.49, 0.4
STICK_S = 0.02  # [s] between two overrides
PATIENCE_S = 90.0  # [s] until armed
SETTLE_S = 10.0  # [s] at the surface before arming, for the board's own estimator


class PlainStation:
    """A ground station that does as little as it can."""

    def __init__(self, link: socket.socket, surge: float = SURGE) -> None:
        """
        Args:
            surge: [-] of its full stick.
        """
        link.settimeout(0.002)
        self._surge, self.mode = surge, -1  # of its newest heartbeat
        self._link, self._codec = link, MavlinkCodec(255, 190)
        self._reader = FrameReader(self._codec)
        self._board: tuple[str, int] | None = None
        self._armed, self._alive, self._due = False, 0.0, 0.0
        self.texts: list[str] = []

    def wait_until_armed(self) -> None:
        began = asked = time.monotonic()
        while not self._armed:
            self.steer(StickMove(0.0))
            now = time.monotonic()
            if now - began > PATIENCE_S:
                raise RuntimeError("the board does not arm")
            if now - began > SETTLE_S and now - asked > 1.0:
                asked = now
                self.send(command(1, MavCommand.DO_SET_MODE, 1, ALT_HOLD))
                self.send(command(1, MavCommand.COMPONENT_ARM_DISARM, 1))

    def steer(self, sticks: StickMove) -> None:
        """Sticks now, then hear the board until the next are due."""
        pulses = {f"chan{n}_raw": 1500 for n in range(1, 7)}
        pulses["chan3_raw"] = round(1500 - 400 * sticks.heave)
        pulses["chan4_raw"] = round(1500 + 400 * YAW * sticks.yaw)
        pulses["chan5_raw"] = round(1500 + 400 * self._surge * sticks.surge)
        target = {"target_system": 1, "target_component": 1, "chan7_raw": 0, "chan8_raw": 0}
        self.send(MavlinkPacket("RC_CHANNELS_OVERRIDE", {**target, **pulses}))
        now = time.monotonic()
        if now > self._alive + 1.0:
            self._alive = now
            self.send(heartbeat())
        self._due = max(now, self._due + STICK_S)
        while time.monotonic() < self._due:
            self._hear()

    def send(self, packet: MavlinkPacket) -> None:
        if self._board is not None:
            self._link.sendto(self._codec.encode(packet), self._board)

    def _hear(self) -> None:
        try:
            data, self._board = self._link.recvfrom(4096)
        except TimeoutError:
            return
        for packet in self._reader.read([data]):
            if packet.name == "HEARTBEAT" and packet.system == 1:  # not of the observer
                self.mode = packet.fields["custom_mode"]
                is_armed = bool(packet.fields["base_mode"] & MavModeFlag.SAFETY_ARMED)
                self._armed = self.mode == ALT_HOLD and is_armed
            elif packet.name == "STATUSTEXT":
                self.texts.append(packet.fields["text"])
