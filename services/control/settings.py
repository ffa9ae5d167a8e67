"""The tables [control…] of a vehicle file."""

from typing import Annotated

import msgspec

from messages.units import NotNegativeSetting
from services.control.allocation import AllocationSettings
from services.control.axis.axis import Gains


class RollPitchGains(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """Roll or pitch held at zero, if the thrusters can drive it. 0, 0: hydrostatic only."""

    kp: NotNegativeSetting = 0.0  # [N m/rad]
    kd: NotNegativeSetting = 0.0  # [N m s/rad]


class CouplingSettings(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """What surge, sway and tilt do to heave (heave_coupling.py)."""

    heave: bool = False  # fed forward; False: left to the disturbance observer
    wake_share: Annotated[float, msgspec.Meta(ge=0.0, le=1.0)] = 1.0  # [-] of the Munk moment


class Settings(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    depth: Gains = Gains(kp=60.0, kd=65.0, ki=12.0, max_error=0.3, max_integral=15.0)
    heading: Gains = Gains(
        kp=8.0, kd=3.0, ki=1.0, max_error=0.6, max_integral=1.0, decay_threshold=0.2
    )
    surge: Gains = Gains(kp=20.0, kd=25.0, ki=3.0, max_error=0.5, max_integral=15.0)
    sway: Gains = Gains(kp=20.0, kd=25.0, ki=3.0, max_error=0.5, max_integral=15.0)
    roll: RollPitchGains = RollPitchGains()
    pitch: RollPitchGains = RollPitchGains()
    allocation: AllocationSettings = AllocationSettings()
    coupling: CouplingSettings = CouplingSettings()
    transfer: Annotated[float, msgspec.Meta(ge=0.05, le=5.0)] = 0.3  # [s] fade between modes
