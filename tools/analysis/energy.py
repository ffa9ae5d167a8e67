"""Energy used by thrusters, computer, camera and sensors."""

import msgspec
import numpy as np

from messages import topics
from tools.analysis.dive import RecordedDive
from tools.recordings.columns import StreamColumns

FASTEST = 20.0  # [1/h] no battery of a drone gives its whole capacity in three minutes
ROUGH = 1e-3  # [-] of the capacity: a gauge may count in steps as large as this, so less used is
# not measured
# [h] Longer no battery of a drone lasts: a BlueROV2 whose thrusters stand still empties its own in
# 18. The drone is fed from elsewhere, as Minerva from its ship, or the gauge does not count all.
LONGEST_H = 24.0


class Energy(msgspec.Struct, frozen=True):
    thrust_squared_n2s: float  # [N² s] sum of thrust² over all thrusters and time
    wh: float  # [Wh] electrical, thrusters and all the rest, from `Actuation`
    battery_wh: float | None  # [Wh] out of the battery
    endurance_h: float | None  # [h] a full battery lasts, used as in this dive


def energy(dive: RecordedDive) -> Energy:
    """Integrals over the whole recording by the trapezium rule, from `Actuation`."""
    actuation = dive[topics.ACTUATION]
    seconds = (actuation["stamp_ns"] - actuation["stamp_ns"][:1]) / 1e9
    used, endurance = _battery(dive)
    return Energy(
        thrust_squared_n2s=float(np.trapezoid(actuation["thrust_squared"], seconds)),
        wh=float(np.trapezoid(actuation["power"], seconds)) / 3600.0,
        battery_wh=used,
        endurance_h=endurance,
    )


def _battery(dive: RecordedDive) -> tuple[float | None, float | None]:
    """[Wh] used and [h] of endurance, where the battery reports them, what it reports was used in
    this dive, and it can be true."""
    battery = dive[topics.BATTERY]
    if battery.count < 2 or not np.isfinite(battery["used_wh"]).all() or _jumped(battery):
        return None, None
    used = float(battery["used_wh"][-1] - battery["used_wh"][0])
    hours = float(battery["stamp_ns"][-1] - battery["stamp_ns"][0]) / 3.6e12
    capacity = float(battery["capacity_wh"][-1])
    if not used > ROUGH * capacity or not capacity >= battery["used_wh"][-1]:  # or not known
        return used, None
    lasts = capacity * hours / used
    return used, lasts if lasts <= LONGEST_H else None


def _jumped(battery: StreamColumns) -> bool:
    """Did the used energy become less, or more by what no battery gives in that time? A fault, a
    restart or another battery does that."""
    steps, hours = np.diff(battery["used_wh"]), np.diff(battery["stamp_ns"]) / 3.6e12
    most = battery["capacity_wh"][1:] * np.maximum(ROUGH, FASTEST * hours)  # NaN: not known
    return bool(np.any(steps < 0.0) or np.any(steps > most))
