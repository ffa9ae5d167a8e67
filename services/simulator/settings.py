"""The table [simulator] of a vehicle file: site, sensors, battery."""

from typing import Annotated

import msgspec

from messages import topics
from messages.units import Positive
from services.marine.mounting import Mounting
from services.marine.vehicle import ATMOSPHERE, SEA_WATER
from services.marine.water import Density
from services.simulator.hull import Hull
from services.simulator.terrain import Terrain
from services.simulator.vibration import Vibration
from services.simulator.waves import Waves

Force = Annotated[float, msgspec.Meta(ge=-5.0, le=5.0)]  # [m/s²]
Rate = Annotated[float, msgspec.Meta(ge=-1.0, le=1.0)]  # [rad/s]
Iron = Annotated[float, msgspec.Meta(ge=-1e-4, le=1e-4)]  # [T]
Scale = Annotated[float, msgspec.Meta(ge=0.5, le=2.0)]  # [-]
IronPart = Annotated[float, msgspec.Meta(ge=-2.0, le=2.0)]  # [-]
SoftIronRow = tuple[IronPart, IronPart, IronPart]
SoftIron = tuple[SoftIronRow, SoftIronRow, SoftIronRow]
NONE = (0.0, 0.0, 0.0)


class SensorErrors(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """The table [simulator.sensor_errors]."""

    accelerometer_offset: tuple[Force, Force, Force] = NONE  # [m/s²]
    accelerometer_scale: tuple[Scale, Scale, Scale] = (1.0, 1.0, 1.0)  # [-]
    gyro_offset: tuple[Rate, Rate, Rate] = NONE  # [rad/s]
    hard_iron: tuple[Iron, Iron, Iron] = NONE  # [T]
    soft_iron: SoftIron = ((1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0))  # [-]
    pressure_offset: Annotated[float, msgspec.Meta(ge=-1e5, le=1e5)] = 0.0  # [Pa]


MAGNETIC_FIELD = (15e-6, 0.0, 49e-6)  # [T] NED; dip 73°, as off Norway
WATER_TEMPERATURE = 8.0  # [°C] at every depth
WATER_NOISE = 0.01  # [K] of its measurement, which the pressure sensor makes as well; assumed
ENCLOSURE_RISE = 15.0  # [°C] above the water
SampleRate = Annotated[float, msgspec.Meta(ge=1.0, le=100.0)]
FieldNoise = Annotated[float, msgspec.Meta(ge=0.0, le=1e-4)]  # [T]
StartHeading = Annotated[float, msgspec.Meta(ge=-6.3, le=6.3)]  # [rad]
ImuNoise = Annotated[float, msgspec.Meta(ge=0.0, le=1.0)]  # far beyond any sensor worth the name
TimeConstant = Annotated[float, msgspec.Meta(ge=1.0, le=1e5)]  # [s]
SensorLatency = Annotated[float, msgspec.Meta(ge=0.0, le=10.0)]
Velocity = Annotated[float, msgspec.Meta(ge=-5.0, le=5.0)]  # [m/s]
Slope = Annotated[float, msgspec.Meta(ge=-2.0, le=2.0)]  # [-] metres down per metre
FixRate = Annotated[float, msgspec.Meta(ge=0.01, le=50.0)]  # [1/s]


class Dvl(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """A Doppler velocity log; rate as in Fernandes et al. 2015."""

    rate: FixRate = 1.0  # [1/s]
    std: Annotated[float, msgspec.Meta(gt=0.0, le=1.0)] = 0.01  # [m/s] of each component
    # [-] one standard deviation, drawn by the seed, of the share by which all velocities are off
    scale_error: Annotated[float, msgspec.Meta(ge=0.0, le=0.1)] = 0.0
    latency: SensorLatency = 0.1  # [s] from the measurement to its message
    reach: Annotated[float, msgspec.Meta(gt=0.0, le=1000.0)] = 30.0  # [m] of altitude
    altitude_std: Annotated[float, msgspec.Meta(ge=0.0, le=10.0)] = 0.05  # [m]


class Usbl(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """Acoustic positioning from a ship; rate below that of Fernandes et al. 2015."""

    rate: FixRate = 0.5  # [1/s]
    std: Annotated[float, msgspec.Meta(gt=0.0, le=100.0)] = 0.5  # [m] of each component
    latency: SensorLatency = 0.5  # [s] of sound, and of the link back down to the vehicle


class CurrentSettings(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """The water's own motion over the ground, the same everywhere."""

    north: Velocity = 0.0  # [m/s] mean, where to
    east: Velocity = 0.0  # [m/s]
    std: Annotated[float, msgspec.Meta(ge=0.0, le=2.0)] = 0.0  # [m/s] of each component about it
    time_constant: TimeConstant = 60.0  # [s] correlation time


class TetherSettings(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """The tether's drag, see surroundings.py."""

    diameter: Annotated[float, msgspec.Meta(gt=0.0, le=0.2)] = 0.0076  # [m] of a thin ROV tether
    drag_coefficient: Annotated[float, msgspec.Meta(ge=0.0, le=5.0)] = 1.2  # [-] of a cylinder
    slack: Annotated[float, msgspec.Meta(ge=0.0, le=10_000.0)] = 5.0  # [m] more than the depth


class Settings(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    # The site.
    floor_depth: Annotated[float, msgspec.Meta(gt=0.0, le=11_000.0)] = 20.0  # [m] where it starts
    slope_north: Slope = 0.0  # [-] by which the floor falls away to the north
    slope_east: Slope = 0.0  # [-] to the east
    terrain: Terrain | None = None  # hills on it; absent: none
    start_heading: StartHeading = 0.0  # [rad] clockwise from north
    atmosphere: Annotated[float, msgspec.Meta(ge=50_000.0, le=120_000.0)] = ATMOSPHERE  # [Pa]
    water_density: Density = SEA_WATER  # [kg/m³], "fresh", "sea" or { temperature, salinity }

    # Optional tables: absent means none.
    current: CurrentSettings | None = None
    tether: TetherSettings | None = None
    hull: Hull | None = None  # what the vehicle file does not say, or says wrongly
    waves: Waves | None = None
    mounting: Mounting | None = None  # where the sensors really are; absent: as in [vehicle]
    sensor_errors: SensorErrors | None = None  # known ones
    vibration: Vibration | None = None

    # [-] of the Munk moment cancelled by the wake (marine/hydrodynamics.py); 0 is ideal flow.
    wake_share: Annotated[float, msgspec.Meta(ge=0.0, le=1.0)] = 1.0

    # The sensors: a typical small MEMS unit; a part's own figures: deploy/sensors. Biases are drawn
    # once per seed. In words of the Allan deviation, noise is its slope of −1/2, drift its floor
    # (0.62 of it after 1.9 time constants).
    imu_rate: Annotated[float, msgspec.Meta(ge=10.0, le=400.0)] = topics.IMU.hz  # [1/s]
    gyro_bias: ImuNoise = 0.0105  # [rad/s] 1σ per axis, 0.6 °/s
    gyro_drift: ImuNoise = 4.8e-5  # [rad/s] 1σ per axis, 10 °/h: bias drift
    gyro_drift_time: TimeConstant = 300.0  # [s] its correlation time
    gyro_noise: ImuNoise = 1.22e-4  # [rad/s/√Hz] 0.007 °/s/√Hz
    gyro_step: ImuNoise = 0.0  # [rad/s] 0: unrounded
    accelerometer_bias: ImuNoise = 0.098  # [m/s²] 1σ per axis, 10 mg
    accelerometer_noise: ImuNoise = 1.5e-3  # [m/s²/√Hz] 150 µg/√Hz
    accelerometer_step: ImuNoise = 0.0  # [m/s²] 0: unrounded
    hard_iron: FieldNoise = 0.2e-6  # [T] 1σ per axis
    magnetometer_noise: FieldNoise = 0.2e-6  # [T] 1σ per axis and sample
    magnetometer_step: FieldNoise = 0.0  # [T] 0: unrounded
    magnetometer_rate: SampleRate = topics.MAGNETOMETER.hz  # [1/s] at most that of the IMU
    pressure_std: Annotated[float, msgspec.Meta(ge=0.0, le=5000.0)] = 500.0  # [Pa] 5 mbar
    pressure_rate: SampleRate = topics.PRESSURE.hz  # [1/s]
    pressure_step: Annotated[float, msgspec.Meta(ge=0.0, le=5000.0)] = 0.0  # [Pa] 0: unrounded

    # Optional sensors: absent means none.
    dvl: Dvl | None = None
    usbl: Usbl | None = None

    # The battery and its loads.
    battery_capacity: Positive = 96.0  # [Wh] Blueye Pioneer (Andrén 2023, §2.1)
    battery_full: Positive = 16.8  # [V] open circuit; four lithium cells, assumed
    battery_empty: Positive = 12.8  # [V] open circuit, assumed
    battery_resistance: Annotated[float, msgspec.Meta(ge=0.0, le=1.0)] = 0.03  # [Ω] assumed
    thruster_power: Positive = 350.0  # [W] of one thruster at its full thrust (Andrén 2023, §2.1)
    hotel_power: Positive = 25.0  # [W] computer, camera, sensors; assumed
