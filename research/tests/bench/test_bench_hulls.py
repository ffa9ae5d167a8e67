"""The table of model errors: its hulls are what they are called, and its lines judge what was
flown. The dives themselves take minutes: `lindy bench --only hulls`."""

import pytest

from lindy.api.dives import Stack
from lindy_research.bench.hull_runs import HULLS, HullDive, file_of, settings
from lindy_research.bench.hulls import judged
from services.simulator.hull import in_the_water
from services.simulator.settings import Settings

VEHICLES = ("pioneer", "bluerov2_heavy", "minerva")
LAST = list(HULLS)[-1]


@pytest.mark.parametrize("vehicle", VEHICLES)
def test_the_simulator_gets_the_hull_and_nobody_else(vehicle: str) -> None:
    (last,) = HULLS[LAST]
    stack = Stack(vehicle=vehicle, overrides=settings(vehicle, last))
    hull = stack.section("simulator", Settings).hull
    assert hull is not None
    real, file = in_the_water(file_of(vehicle), hull), file_of(vehicle)
    assert real.mass == pytest.approx(0.7 * file.mass)
    assert real.inertia == pytest.approx([0.7 * part for part in file.inertia])
    assert real.added_mass == pytest.approx([0.7 * part for part in file.added_mass])
    assert real.quadratic_damping == pytest.approx([part / 2 for part in file.quadratic_damping])
    assert hull.thrust_scale == 1.2
    lags = [thruster.time_constant for thruster in file.thruster]
    assert hull.time_constant == pytest.approx(2.0 * max(lags))
    assert stack.section("vehicle", type(file)) == file


def dive(bounce: float, overshoot: float, heading: float) -> HullDive:
    return HullDive((1.0, bounce), (0.1, overshoot), 50.0, heading)


@pytest.mark.parametrize(
    ("line", "flown", "missed"),
    [
        ("nominal", dive(39.0, 0.9, 20.0), []),
        ("nominal", dive(41.0, 0.9, 2.0), ["bounce back"]),
        ("lag ×2", dive(39.0, 1.1, 2.0), ["yaw overshoot"]),
        ("thrust −40 %", dive(39.0, 0.9, 3.1), ["heading error"]),
        (LAST, dive(69.0, 0.9, 20.0), []),
        (LAST, dive(71.0, 0.9, 20.0), ["bounce back"]),
    ],
)
def test_the_worst_stop_of_a_line_is_judged(line: str, flown: HullDive, missed: list[str]) -> None:
    found = judged("pioneer", line, [dive(1.0, 0.1, 0.1), flown])
    assert [f.name.split(": ")[1].split(",")[0] for f in found if f.met is False] == missed
    assert found[0].ours == max(flown.bounces)
    assert found[0].note.endswith("of 4")
