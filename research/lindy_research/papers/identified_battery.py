"""What the thesis' simulated thrust costs in electricity, by the battery of the simulator."""

from functools import cache

import numpy as np

from lindy.api.dives import Stack
from lindy.api.vehicle import Vehicle
from lindy_research.papers.identified_plant import DT, Floats
from lindy_research.papers.identified_runs import run
from services.simulator.propulsion import Battery
from services.simulator.settings import Settings


@cache
def thruster_energy(jerk: float) -> Floats:
    """[J] Used up to each sample of the pilot's log by the stand-in's two forward thrusters, which
    share the force; for an end jerk [m/s³] or `NAIVE`."""
    vehicle = Stack().section("vehicle", Vehicle)
    forward = [thruster.direction[0] for thruster in vehicle.thruster]
    battery = Battery(vehicle, Settings())
    watts: list[float] = []
    for force in run(jerk, "log").thrust.tolist():
        battery.feed([force * share / sum(forward) for share in forward], DT)
        watts.append(battery.power - hotel_power())
    return np.cumsum(watts) * DT


def hotel_power() -> float:
    """[W] Of everything that is not a thruster."""
    return Settings().hotel_power


def longer(naive: float, jerky: float) -> float:
    """[%] By how much the battery lasts longer with the second thrust power [W]."""
    return 100 * ((naive + hotel_power()) / (jerky + hotel_power()) - 1)


def speed_for(percent: float, naive: float, jerky: float) -> float:
    """[-] How much faster the log must be driven for the battery to last `percent` longer. The
    plant is linear, so all forces grow with the speed and thrust power with its power 1.5."""
    gain = percent / 100
    return (gain * hotel_power() / (naive - (1 + gain) * jerky)) ** (2 / 3)
