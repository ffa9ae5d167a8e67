"""What a screen hears of the vehicle."""

from messages import topics
from messages.control import ThrusterCommand
from services.runtime.node.node import Node
from services.vehicle_view.view import Newest, believed

LOOK_HZ = 25.0  # [1/s] often enough that no port overflows at 100 Hz


class VehiclePorts:
    """Subscribes to everything that a `VehicleView` is made of."""

    def __init__(self, node: Node) -> None:
        self._status = node.latest(topics.STATUS)
        self._thrusters = node.latest(topics.THRUSTERS, onlooker=True)  # late over a slow link
        self._state = node.latest(topics.STATE)
        self._reference = node.latest(topics.REFERENCE)
        self._battery = node.latest(topics.BATTERY)
        self._link = node.latest(topics.LINK)
        self._clock = node.latest(topics.CLOCK)
        self._latency = node.latest(topics.LATENCY)

    def thrusters(self, now: int) -> ThrusterCommand | None:
        """Control's newest command, however old."""
        return self._thrusters.newest(now)

    def newest(self, now: int) -> Newest:
        """To be called `LOOK_HZ` times a second."""
        status = self._status.newest(now)
        return Newest(
            status=None if status is None else believed(status, self.thrusters(now)),
            state=self._state.newest(now),
            reference=self._reference.newest(now),
            battery=self._battery.newest(now),
            link=self._link.newest(now),
            clock=self._clock.newest(now),
            latency=self._latency.newest(now),
        )
