"""The simulated vehicle under the board: motor pulses in, telemetry messages out."""

from collections.abc import Sequence
from math import copysign
from statistics import fmean

from msgspec.structs import replace

from messages.control import ThrusterCommand
from messages.events import Outbox
from messages.sensors import MagnetometerSample, PressureSample
from services.ardusub.mixing import FRAMES, senses
from services.marine.vehicle import CURVES, Thruster, Vehicle
from services.mavlink_io.packet import MavlinkPacket
from services.simulator.core import Settings, Simulator, at_the_surface

G = 9.80665  # [m/s²] of ArduPilot's milli-g
GAUSS_PER_TESLA = 1e4
MISSCALED = 1e6  # [-] the compass in HIGHRES_IMU of 4.7-early
INSIDE = 31.5  # [°C] of the enclosure


class HullDouble:
    """Lindy's simulator, driven by pulses."""

    def __init__(
        self, vehicle: Vehicle, settings: Settings, seed: int, wired_as: int, compass: float
    ) -> None:
        """
        Args:
            compass: [-] by which HIGHRES_IMU is wrong.
            wired_as: FRAME_CONFIG of the real wiring, whatever the parameter says.
        """
        self.simulator = Simulator(
            vehicle, settings, seed, at_the_surface(vehicle, settings), Outbox()
        )
        # Measured since the firmware took the means, and these.
        self._pressures: list[PressureSample] = []
        self._pressure: PressureSample | None = None
        self._fields: list[MagnetometerSample] = []
        self._field: MagnetometerSample | None = None
        self._gauss = compass * GAUSS_PER_TESLA
        self._thrusters = vehicle.thruster
        self._senses = senses(FRAMES[wired_as], vehicle.thruster)

    def drive(self, pulses: Sequence[int], now: int) -> None:
        """[µs] Per motor, from now [ns] on."""
        pairs = zip(self._thrusters, self._senses, pulses, strict=True)
        thrust = tuple([sense * _newtons(t, (pulse - 1500) / 400.0) for t, sense, pulse in pairs])
        command = ThrusterCommand(
            stamp_ns=now, sensor_ns=None, pilot_ns=None, thrust=thrust, ttl_ms=1000.0, armed=True
        )
        self.simulator.obey(command, now)

    def measure(self, now: int) -> None:
        """As depth sensor and compass do, much faster than their values are taken over."""
        self.simulator.advance(now)
        if (pressure := self.simulator.pressure()) is not None:
            self._pressures.append(pressure)
        if (field := self.simulator.magnetometer()) is not None:
            self._fields.append(field)

    def take_over(self) -> None:
        """Ten times a second: the mean since the last time, or what there was where none came."""
        if self._pressures:
            mean = fmean(sample.pressure for sample in self._pressures)
            self._pressure = replace(self._pressures[-1], pressure=mean)
            self._pressures = []
        if self._fields:
            x, y, z = (fmean(part) for part in zip(*[m.field for m in self._fields], strict=True))
            self._field = replace(self._fields[-1], field=(x, y, z))
            self._fields = []

    def message(self, name: str, boot_us: int, now: int) -> MavlinkPacket | None:
        """A telemetry message now; None where a simulated fault keeps the sensor silent."""
        self.simulator.advance(now)
        if self._field is None:
            self.measure(now)
            self.take_over()
        if name in ("RAW_IMU", "SCALED_IMU2", "HIGHRES_IMU"):
            return self._imu(name, boot_us)
        if name == "SCALED_PRESSURE2":
            sample = self._pressure
            if sample is None:
                return None
            return MavlinkPacket(name, {
                "time_boot_ms": boot_us // 1000,
                "press_abs": sample.pressure / 100.0,
                "press_diff": 0.0,
                "temperature": round(100.0 * (sample.temperature or 0.0)),
            })  # fmt: skip
        if name == "SCALED_PRESSURE":
            return MavlinkPacket(name, {
                "time_boot_ms": boot_us // 1000, "press_abs": 1010.0, "press_diff": 0.0,
                "temperature": round(100.0 * INSIDE),
            })  # fmt: skip
        if name == "SYS_STATUS":
            return self._battery()
        if name == "ATTITUDE":
            truth = self.simulator.truth()
            p, q, r = truth.angular_rate
            return MavlinkPacket(name, {
                "time_boot_ms": boot_us // 1000, "roll": truth.roll, "pitch": truth.pitch,
                "yaw": truth.heading, "rollspeed": p, "pitchspeed": q, "yawspeed": r,
            })  # fmt: skip
        return None

    def _imu(self, name: str, boot_us: int) -> MavlinkPacket | None:
        imu, compass = self.simulator.imu(), self._field
        if imu is None or compass is None:
            return None
        if name == "HIGHRES_IMU":
            values = (*imu.specific_force, *imu.angular_rate,
                      *[self._gauss * part for part in compass.field])  # fmt: skip
            keys = [f"{axis}{part}" for part in ("acc", "gyro", "mag") for axis in "xyz"]
            rest = {"abs_pressure": 0.0, "diff_pressure": 0.0, "pressure_alt": 0.0,
                    "temperature": 30.0, "fields_updated": 0x1FF}  # fmt: skip
            return MavlinkPacket(
                name, {"time_usec": boot_us, **dict(zip(keys, values, strict=True)), **rest}
            )
        whole = [
            *[round(1000.0 * part / G) for part in imu.specific_force],
            *[round(1000.0 * part) for part in imu.angular_rate],
            *[round(1000.0 * GAUSS_PER_TESLA * part) for part in compass.field],
        ]
        keys = [f"{axis}{part}" for part in ("acc", "gyro", "mag") for axis in "xyz"]
        time = (
            {"time_usec": boot_us, "id": 0} if name == "RAW_IMU"
            else {"time_boot_ms": boot_us // 1000}
        )  # fmt: skip
        return MavlinkPacket(
            name, {**time, **dict(zip(keys, whole, strict=True)), "temperature": 3000}
        )

    def _battery(self) -> MavlinkPacket | None:
        sample = self.simulator.battery()
        if sample is None:
            return None
        zeros = ("onboard_control_sensors_present", "onboard_control_sensors_enabled",
                 "onboard_control_sensors_health", "load", "drop_rate_comm", "errors_comm",
                 "errors_count1", "errors_count2", "errors_count3", "errors_count4")  # fmt: skip
        return MavlinkPacket("SYS_STATUS", {
            **dict.fromkeys(zeros, 0),
            "voltage_battery": round(1000.0 * sample.voltage),
            "current_battery": -1 if sample.current is None else round(100.0 * sample.current),
            "battery_remaining": -1,
        })  # fmt: skip


def _newtons(thruster: Thruster, share: float) -> float:
    """[N] Along the motor's own output, for a share of the pulse's span -1 … 1."""
    curve = CURVES.get(thruster.curve)
    if curve is None:
        return share * thruster.max_thrust
    if abs(share) < curve.silent - 1e-9:
        return 0.0
    newtons = curve.thrust(min(curve.top, abs(share)))
    return copysign(max(newtons, thruster.dead_band), share)
