"""From newtons to an ESC command, and a model of open-loop thrusters.

An ESC without feedback does not report its thrust. It is modelled from the command by dead-band,
limits (the driver inverts the rest of the thrust curve) and lag; then `Actuation.measured` is
False.
"""

from collections.abc import Sequence

from services.marine.summation import plain_sum
from services.marine.vehicle import CURVES, Thruster, decay, driven


def share_of_voltage(thruster: Thruster, newtons: float) -> float:
    """[-] −1 … 1: ESC command for a thrust [N], by the thruster's curve; without one, a share of
    its limit. Zero inside the dead-band."""
    settles_at = driven(thruster, newtons)
    if settles_at == 0.0:
        return 0.0
    if (curve := CURVES.get(thruster.curve)) is not None:
        return curve.share(settles_at)
    reverse, forward = thruster.limits
    return settles_at / forward if settles_at > 0 else -settles_at / reverse


class OpenLoopThrust:
    """Modelled thrust of thrusters without feedback, from rest."""

    def __init__(self, thrusters: Sequence[Thruster]) -> None:
        self._lags = [_Lagging(thruster) for thruster in thrusters]

    def drive(self, thrust: Sequence[float], now: int) -> None:
        """Command this thrust [N] per thruster from `now` [ns] on."""
        for lagging, newtons in zip(self._lags, thrust, strict=True):
            lagging.drive(newtons, now)

    def believed(self, now: int) -> tuple[float, ...]:
        """[N] Modelled thrust per thruster at `now` [ns]."""
        return tuple([lagging.at(now) for lagging in self._lags])


class _Lagging:
    """One thruster: final value minus decaying modes (services/marine/vehicle.py)."""

    def __init__(self, thruster: Thruster) -> None:
        self._thruster = thruster
        self._modes = thruster.modes
        self._gaps: list[complex] = [0.0] * len(self._modes)  # [N] gap of each mode at `since`
        self._settles_at = 0.0  # [N]
        self._since = 0  # [ns]

    def drive(self, newtons: float, now: int) -> None:
        settles_at = driven(self._thruster, newtons)
        if settles_at == self._settles_at:
            return
        step = settles_at - self._settles_at
        self._gaps = [
            gap + mode.share * step for gap, mode in zip(self._left(now), self._modes, strict=True)
        ]
        self._settles_at, self._since = settles_at, now

    def at(self, now: int) -> float:
        return self._settles_at - plain_sum(gap.real for gap in self._left(now))

    def _left(self, now: int) -> list[complex]:
        """[N] Gap of each mode at `now`."""
        seconds = max(0, now - self._since) / 1e9
        return [
            decay(mode.pole, seconds) * gap
            for mode, gap in zip(self._modes, self._gaps, strict=True)
        ]
