"""Whatever the accelerometer says, the depth stays with a pressure sensor that works."""

import numpy as np
import pytest

from services.estimation.depth.depth_filter import DepthSettings
from services.estimation.depth.depth_observer import Atmosphere, DepthObserver
from services.marine.vehicle import GRAVITY

AIR, DENSITY, DEPTH = 101_325.0, 1025.0, 2.0  # [Pa], [kg/m³], [m]


@pytest.mark.parametrize("wrong", [3.0, -6.0, 10.0])
@pytest.mark.parametrize("seed", range(5))
def test_a_step_of_the_acceleration_does_not_take_the_depth_along(wrong: float, seed: int) -> None:
    rng, pressure = np.random.default_rng(seed), AIR + DENSITY * GRAVITY * DEPTH
    observer = DepthObserver(DepthSettings(), Atmosphere(AIR, 0.0), DENSITY, 0.0)
    observer.start(pressure, 100, 0)
    away: list[float] = []
    for step in range(1, 600):
        at_ns = step * 10_000_000
        observer.predict(0.0 if step < 300 else wrong, at_ns)
        if step % 2 == 0:
            observer.pressure(pressure + 500.0 * float(rng.standard_normal()), at_ns)
        away.append(abs(observer.estimates(at_ns)[0].value - DEPTH))
    assert observer.trial is not None
    assert max(away[:299]) < 0.1
    # A gate of six standard deviations, and a quarter of a second at most at the rate by then.
    assert max(away) < 2.0
    assert max(away[400:]) < 0.3
