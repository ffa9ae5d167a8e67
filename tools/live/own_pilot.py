"""The pilot of this side: the one whose commands are published here.

Commands go from the topside to the drone only, so that no other side's commands are heard here.
"""

from messages import topics
from messages.vehicle import VehicleStatus
from services.runtime.node.node import Node

LOOK_HZ = 25.0  # [1/s] often enough that a port that keeps the newest 16 does not overflow at 50 Hz


class OwnPilot:
    """Follows the commands of this side."""

    def __init__(self, node: Node) -> None:
        self.heard = False
        self.epoch = 0  # authority epoch; 0: it was never granted control
        self.source = ""  # its name
        self._commands = node.latest(topics.PILOT_COMMAND)
        node.every(LOOK_HZ, self._look)

    def in_control(self, status: VehicleStatus) -> bool:
        """Was the newest epoch granted to this pilot?"""
        return status.epoch == self.epoch

    def _look(self, now: int) -> None:
        if (command := self._commands.newest(now)) is not None:
            self.heard, self.epoch, self.source = True, command.epoch, command.source
