"""The battery: power of the thrusters, and the remaining energy.

Power of a thruster grows with |thrust| to the power 1.5 (momentum theory of a propeller at rest in
the water: P = T √(T / 2ρA)), scaled to the known power at full thrust, each way.
"""

from collections.abc import Sequence

from messages.sensors import BatterySample
from services.marine.vehicle import Vehicle
from services.simulator.settings import Settings


class Battery:
    def __init__(self, vehicle: Vehicle, settings: Settings, used_wh: float = 0.0) -> None:
        self.used_wh = used_wh  # [Wh]
        self.power = settings.hotel_power  # [W] drawn now
        self._settings = settings
        self._limits = [thruster.limits for thruster in vehicle.thruster]  # [N]

    def feed(self, thrust: Sequence[float], seconds: float) -> None:
        """Draw the power of this thrust [N] per thruster for `seconds`."""
        load = 0.0  # [-] one for each thruster at its limit
        for newtons, (reverse, forward) in zip(thrust, self._limits, strict=True):
            share = newtons / forward if newtons >= 0 else newtons / reverse
            load += share * share**0.5
        self.power = self._settings.hotel_power + self._settings.thruster_power * load
        self.used_wh += self.power * seconds / 3600

    @property
    def left_wh(self) -> float:
        """[Wh]"""
        return max(0.0, self._settings.battery_capacity - self.used_wh)

    @property
    def empty(self) -> bool:
        """The vehicle still runs: the battery model is too rough to end a dive."""
        return self.left_wh == 0.0

    @property
    def voltage(self) -> float:
        """[V] Under the present load."""
        s = self._settings
        left = self.left_wh / s.battery_capacity
        return self._under_load(s.battery_empty + left * (s.battery_full - s.battery_empty))

    def _under_load(self, open_circuit: float) -> float:
        return max(
            0.0, open_circuit - self._settings.battery_resistance * self.power / open_circuit
        )

    def sample(self, now: int, share: float | None = None) -> BatterySample:
        """Voltage falls linearly with the charge, and with the current.

        Args:
            share: [-] of the charge, where a fault says how much is left.
        """
        s = self._settings
        left = self.left_wh / s.battery_capacity if share is None else share
        open_circuit = s.battery_empty + left * (s.battery_full - s.battery_empty)
        current = self.power / open_circuit
        return BatterySample(
            stamp_ns=now,
            voltage=self._under_load(open_circuit),
            current=current,
            used_wh=self.used_wh if share is None else (1.0 - share) * s.battery_capacity,
            capacity_wh=s.battery_capacity,
        )
