"""The DVL: how it is mounted, from a dive that starts, stops and turns."""

from array import array
from math import degrees, hypot

import numpy as np

from messages.message import Message
from messages.sensors import DvlSample, ImuSample
from services.marine.vehicle import SEA_WATER, Vehicle
from services.vehicle.mounting import AtOrigin
from tools.calibrate.dvl_fit import DvlFit, fitted, stretches
from tools.calibrate.guide import CalibrationError, SensorFound, Setting
from tools.calibrate.noise import Floats

MANOEUVRE = "surge, stop, sway, stop, turn on the spot, dive and rise"
DVL_TABLE = "vehicle.mounting.dvl"
MOST_YAW, MOST_LEAN = 0.035, 0.035  # [rad] 1σ; less sure is not stated
MOST_ARM = 0.05  # [m] 1σ
MOST_SCALE = 0.02  # [-] 1σ
SURE = 3.0  # [σ] a scale or an offset of the stamps that is less off is none
LATE = 0.02  # [s] of the stamps; less is not worth a sentence
LOOK_S = 10.0  # [s] between two looks, while the samples come in


class DvlGuide:
    """Waits until the samples tell the rotation and the lever arm."""

    def __init__(self, vehicle: Vehicle) -> None:
        self._at_origin = AtOrigin(vehicle.mounting, SEA_WATER, vehicle.calibration)
        self._before = vehicle.mounting.dvl.position
        self._imu, self._dvl = array("d"), array("d")
        self._stamps = [-1, -1]  # [ns] newest of IMU and DVL
        self._begin_ns: int | None = None
        self._unlocked = 0  # samples without a velocity
        self._look_s = LOOK_S
        self._fit: DvlFit | None = None

    def see(self, sample: Message) -> None:
        if isinstance(sample, ImuSample) and self._newer(0, sample.stamp_ns):
            sample = self._at_origin.imu(sample)
            self._imu.extend((self._seconds(0), *sample.angular_rate, *sample.specific_force))
        elif isinstance(sample, DvlSample) and self._newer(1, sample.stamp_ns):
            if sample.velocity is None:
                self._unlocked += 1
            else:
                self._dvl.extend((self._seconds(1), *sample.velocity, sample.std))

    def _newer(self, which: int, stamp_ns: int) -> bool:
        """Seconds count from the first sample, whichever: a double holds them to the ns."""
        if self._begin_ns is None:
            self._begin_ns = stamp_ns
        elif self._stamps[which] >= stamp_ns:
            return False
        self._stamps[which] = stamp_ns
        return True

    def _seconds(self, which: int) -> float:
        return (self._stamps[which] - (self._begin_ns or 0)) * 1e-9

    @property
    def done(self) -> bool:
        if self._seconds(0) >= self._look_s:
            self._look_s = self._seconds(0) + LOOK_S
            self._fit = self._fitted()
        fit = self._fit
        return fit is not None and _sees_yaw(fit) and _sees_lean(fit) and _sees_arm(fit)

    @property
    def prompt(self) -> str:
        fit = self._fit
        if fit is None:
            far = f"{len(self._dvl) // 5} velocities so far"
        else:
            far = f"its yaw is known to {degrees(fit.std[2]):.2g} deg"
        return f"{MANOEUVRE}; {far}"

    def result(self) -> SensorFound:
        """
        Raises:
            CalibrationError: there is nothing to compare, or it was not moved enough.
        """
        velocities, imu = len(self._dvl) // 5, len(self._imu) // 7
        if velocities == 0:
            why = "there is no sample of sensor/dvl"
            if self._unlocked:
                why = f"none of its {self._unlocked} samples has a velocity: no lock on the bottom"
            raise CalibrationError(f"dvl: {why}")
        if (fit := self._fitted()) is None:
            raise CalibrationError(
                f"dvl: {velocities} velocities beside {imu} samples of sensor/imu are never 6 in a "
                f"row without a gap in one or the other"
            )
        if fit.left_out > fit.used:
            raise CalibrationError(
                f"dvl: {fit.left_out} of {fit.left_out + fit.used} stretches of 15 s do not fit "
                f"the IMU; is [vehicle.mounting.imu] right, and did the DVL see the bottom?"
            )
        if not _sees_yaw(fit):
            raise CalibrationError(
                f"dvl: its yaw is known to {degrees(fit.std[2]):.2g} deg, needed are "
                f"{degrees(MOST_YAW):.2g}; fly {MANOEUVRE} (lindy dive --pilot script:dvl_check)"
            )
        return self._told(fit)

    def _fitted(self) -> DvlFit | None:
        return fitted(stretches(_table(self._imu, 7), _table(self._dvl, 5)))

    def _told(self, fit: DvlFit) -> SensorFound:
        out = f", {fit.left_out} left out because they do not fit" if fit.left_out else ""
        remarks = [f"dvl: from {fit.used} stretches of up to 15 s{out}"]
        settings = [_rotation(fit)]
        if not _sees_lean(fit):
            remarks.append(
                "dvl: how it leans is not seen, and taken as level; dive and rise, surge"
            )
        if _sees_arm(fit):
            x, y, z = *fit.arm[:2].tolist(), self._before[2]
            about = "its height is that of before: nothing tells it"
            std = (float(fit.std[4]), float(fit.std[5]))
            settings.append(Setting("position", (x, y, z), std, "m", about, DVL_TABLE))
        else:
            remarks.append("dvl: where it sits is not seen; turn on the spot")
        scale, std = 1.0 / fit.scale, float(fit.std[3])
        if abs(fit.scale - 1.0) > SURE * std and std <= MOST_SCALE:
            about = "against the accelerometer's own scale"
            settings.append(Setting("dvl_scale", scale, (std,), "-", about))
        else:
            remarks.append(f"dvl: its scale is 1 as far as is seen: {scale:.3f} ± {std:.2g}")
        if abs(fit.stamps) > max(LATE, SURE * float(fit.std[13])):
            late, way = abs(fit.stamps), "later" if fit.stamps > 0.0 else "earlier"
            remarks.append(
                f"dvl: it measures {1000.0 * late:.0f} ± {1000.0 * fit.std[13]:.0f} ms {way} than "
                f"its time stamps say; see `latency` of its driver"
            )
        return SensorFound(tuple(settings), tuple(remarks))


def _rotation(fit: DvlFit) -> Setting:
    """As measured; level where that is not seen."""
    yaw, (ahead, aside) = fit.yaw, fit.lean
    about = f"its X axis {degrees(yaw):.2f} ± {degrees(fit.std[2]):.2g} deg clockwise from the bow"
    rotation: Floats = fit.rotation
    if _sees_lean(fit):
        about += (
            f", leaning {degrees(ahead):.2f} ± {degrees(fit.std[1]):.2g} deg forward and "
            f"{degrees(aside):.2f} ± {degrees(fit.std[0]):.2g} to starboard"
        )
    else:
        x, y = fit.rotation[:2, 0] / hypot(*fit.rotation[:2, 0].tolist())
        rotation = np.array([[x, -y, 0.0], [y, x, 0.0], [0.0, 0.0, 1.0]])
    rows = tuple(tuple(row) for row in rotation.tolist())
    return Setting("rotation", rows, (), "-", about, DVL_TABLE)


def _sees_yaw(fit: DvlFit) -> bool:
    return bool(fit.std[2] <= MOST_YAW)


def _sees_lean(fit: DvlFit) -> bool:
    return bool(max(fit.std[:2]) <= MOST_LEAN)


def _sees_arm(fit: DvlFit) -> bool:
    return bool(max(fit.std[4:6]) <= MOST_ARM)


def _table(values: "array[float]", width: int) -> Floats:
    return np.frombuffer(values, dtype=np.float64).reshape(-1, width).copy()
