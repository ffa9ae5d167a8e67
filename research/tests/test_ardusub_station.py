"""The sea around ArduSub's simulator, and how well a place is held in it."""

import json
from math import cos, sin
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from lindy_research.ardusub_comparison.releases import TrueMotion
from lindy_research.ardusub_comparison.sea import CurrentChange, Sea, in_body
from lindy_research.ardusub_comparison.station_keeping import PLAN, STAGE_S, judged_station
from services.marine.attitude import down_in_body

Angle = st.floats(-3.0, 3.0)


def state(**changed: float) -> dict[str, Any]:
    still = dict.fromkeys(("vn", "ve", "vd", "roll", "pitch", "yaw", "alt"), 0.0)
    return still | changed


@given(Angle, st.floats(-1.4, 1.4), Angle)
def test_a_drone_that_sinks_is_seen_along_the_worlds_down(
    roll: float, pitch: float, yaw: float
) -> None:
    quaternion = (
        cos(roll / 2) * cos(pitch / 2),
        sin(roll / 2) * cos(pitch / 2),
        cos(roll / 2) * sin(pitch / 2),
        -sin(roll / 2) * sin(pitch / 2),
    )
    seen = in_body(state(vd=1.0, roll=roll, pitch=pitch, yaw=yaw))
    assert seen == pytest.approx(down_in_body(quaternion), abs=1e-9)
    level = in_body(state(vn=cos(yaw), ve=sin(yaw), yaw=yaw))
    assert level == pytest.approx((1.0, 0.0, 0.0), abs=1e-9)


def test_both_are_told_the_same_motion_and_the_current_comes_when_it_is_due() -> None:
    sea = Sea([CurrentChange(0.0, 0.2, 90.0)], wait_s=2.0)
    told = [
        packet
        for n in range(500)
        for packet in sea.see(100.0 + 0.02 * n, state(vn=0.3, alt=-0.01 * n))
    ]
    sea.dvl.power_off()
    deltas = [packet.fields for packet in told if packet.name == "VISION_POSITION_DELTA"]
    seconds = [delta["time_delta_usec"] / 1e6 for delta in deltas]
    way = [delta["position_delta"][0] for delta in deltas]
    assert sum(way) / sum(seconds) == pytest.approx(0.3, abs=0.002)
    assert len(deltas) > 9.0 * 10
    sets = {p.fields["param_id"]: p.fields["param_value"] for p in told if p.name == "PARAM_SET"}
    assert sets == {"SIM_WIND_SPD": 0.2, "SIM_WIND_DIR": 90.0}
    assert sea.began == pytest.approx(100.0 + 4.02 + 2.0)
    assert json.dumps(deltas)


def test_a_place_that_is_left_and_found_again_is_judged_by_both() -> None:
    """Half a metre off for a while, in the second current, and 10 mm for ever."""
    t = np.arange(0.0, 4 * STAGE_S + 20.0, 0.02)
    off = np.where(t > STAGE_S, 0.01, 0.0)
    off += 0.5 * np.exp(-(((t - 2 * STAGE_S - 4.0) / 1.0) ** 2))
    still = np.zeros_like(t)
    truth = TrueMotion(t, still, still, np.gradient(off, t), still, still, still)
    found = judged_station("it", truth, 0.0, t[-1] - 10.0)
    assert [stage.settled for stage in found.stages] == pytest.approx(
        [0.0, 0.01, 0.01, 0.01], abs=1e-3
    )
    assert found.stages[2].most == pytest.approx(0.51, abs=0.01)
    assert len(found.stages) == len(PLAN)
    assert abs(found.stop.bounce) < 1e-3
