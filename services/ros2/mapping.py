"""The one table of what Lindy's messages are in ROS 2, live and in a bag. Pure.

ROS has the world's axes east, north, up (ENU) and the body's forward, left, up (FLU), by its REP
103; Lindy has north, east, down (NED) and forward, starboard, down (FRD). Everything is turned
here, and here alone. Units are the same: SI and radians.

What is not known is said by a covariance, never by a zero that looks measured: -1 in front of a
covariance says that there is no orientation at all (sensor_msgs/Imu), `UNKNOWN` that a number means
nothing.
"""

from collections import defaultdict
from collections.abc import Callable, Iterable, Iterator, Mapping
from math import isfinite, nan, sqrt
from typing import Any, NamedTuple, Protocol

import numpy as np
from rosbags.typesys import Stores, get_typestore
from rosbags.typesys.stores import ros2_jazzy as ros

from messages import cameras, events, topics
from messages.health import LATE_MS, Health, LogLine
from messages.message import Estimate, Message
from messages.pilot import PilotCommand
from messages.sensors import (
    BatterySample,
    DvlSample,
    ImuSample,
    MagnetometerSample,
    PressureSample,
)
from messages.state import VehicleState
from messages.topic import AnyTopic
from messages.units import Quaternion, Vec3
from messages.vehicle import Truth, VehicleStatus
from messages.video import AccessUnit, Assembler, VideoPart
from services.marine.attitude import LEVEL, down_in_body, from_north
from services.marine.mounting import Mounting
from services.piloting.pilot_intents import Press
from services.piloting.sticks import Sticks
from services.ros2.core import RosSticks
from services.ros2.rmw_zenoh import Attachment
from services.vehicle.mounting import MountedAxes
from services.vehicle_view.view import Newest, vehicle_view
from services.vehicle_view.words import acting

STORE = get_typestore(Stores.ROS2_JAZZY)
UNKNOWN = 1e6  # a variance that says that the value means nothing
STEEPEST = 0.2  # [-] cosine of a tilt beyond which depth rate says nothing of heave
HALF = sqrt(0.5)
OK, WARN, ERROR = 0, 1, 2  # of diagnostic_msgs/DiagnosticStatus
LEVELS = {"info": 20, "warning": 30, "error": 40}  # of rcl_interfaces/Log

JOY = "sensor_msgs/msg/Joy"


# Frames.


def flu(v: Vec3) -> Vec3:
    """FRD to FLU, and back."""
    return v[0], -v[1], -v[2]


def enu(v: Vec3) -> Vec3:
    """NED to ENU, and back."""
    return v[1], v[0], -v[2]


def enu_from_flu(q_NB: Quaternion) -> Quaternion:
    """The attitude of FLU in ENU as w, x, y, z: q_(ENU←NED) ⊗ q_NB ⊗ q_(FRD←FLU), which are half
    turns about the line to the north-east and about the forward axis."""
    w, x, y, z = q_NB
    return -HALF * (w + z), -HALF * (x + y), HALF * (y - x), HALF * (z - w)


# Parts of messages.


def _stamp(utc_ns: int) -> Any:
    return ros.builtin_interfaces__msg__Time(sec=utc_ns // 10**9, nanosec=utc_ns % 10**9)


def _header(utc_ns: int, frame: str) -> Any:
    return ros.std_msgs__msg__Header(stamp=_stamp(utc_ns), frame_id=frame)


def _vector(v: Vec3) -> Any:
    return ros.geometry_msgs__msg__Vector3(x=v[0], y=v[1], z=v[2])


def _quaternion(q: Quaternion) -> Any:
    w, x, y, z = q
    return ros.geometry_msgs__msg__Quaternion(x=x, y=y, z=z, w=w)


def _diagonal(variances: Iterable[float]) -> "np.ndarray[tuple[int, ...], np.dtype[np.float64]]":
    """A covariance, row by row."""
    return np.diag(np.fromiter(variances, np.float64)).ravel()


def _variance(estimate: Estimate | None) -> float:
    return estimate.std * estimate.std if estimate is not None and estimate.valid else UNKNOWN


def _value(estimate: Estimate | None) -> float:
    return estimate.value if estimate is not None and estimate.valid else 0.0


class RosFrames(NamedTuple):
    """The drone in ROS: names of its frames, and where its sensors sit."""

    base: str  # forward, left, up at the vehicle's origin
    odom: str  # east, north, up at the surface
    imu: MountedAxes
    magnetometer: MountedAxes
    dvl: MountedAxes
    places: Mapping[str, Vec3]  # [m] FRD, of each frame of a sensor; along the vehicle's axes

    def at(self, sensor: str) -> str:
        """The frame of what this sensor measures, in the vehicle's axes."""
        frame = f"{self.base.partition('/')[0]}/{sensor}"
        return frame if frame in self.places else self.base


def frames_of(name: str, mounting: Mounting | None) -> RosFrames:
    """
    Args:
        mounting: None: not known. Sensors have no frames of their own, and the vehicle's axes.
    """
    places: dict[str, Vec3] = {}
    if mounting is not None:
        places = {
            f"{name}/imu": mounting.imu.position,
            f"{name}/dvl": mounting.dvl.position,
            f"{name}/pressure": mounting.pressure.position,
        }
    known = mounting or Mounting()
    return RosFrames(
        f"{name}/base_link",
        f"{name}/odom",
        MountedAxes(known.imu),
        MountedAxes(known.magnetometer),
        MountedAxes(known.dvl),
        places,
    )


# Messages. Each is made of the drone's frames, Lindy's message and its time [ns] UTC. None: nothing
# is to be said.


def imu(frame: RosFrames, sample: ImuSample, utc_ns: int) -> Any:
    """In the body's axes, where the sensor sits, not corrected. Specific force at rest is (0, 0, g)
    in ROS too."""
    axes = frame.imu
    nothing = np.zeros(9)
    none = np.array([-1.0, *[0.0] * 8])
    return ros.sensor_msgs__msg__Imu(
        header=_header(utc_ns, frame.at("imu")),
        orientation=_quaternion((1.0, 0.0, 0.0, 0.0)),
        orientation_covariance=none,
        angular_velocity=_vector(flu(axes.to_body(sample.angular_rate))),
        angular_velocity_covariance=nothing,
        linear_acceleration=_vector(flu(axes.to_body(sample.specific_force))),
        linear_acceleration_covariance=nothing,
    )


def magnetic_field(frame: RosFrames, sample: MagnetometerSample, utc_ns: int) -> Any:
    field = frame.magnetometer.to_body(sample.field)
    return ros.sensor_msgs__msg__MagneticField(
        header=_header(utc_ns, frame.base),
        magnetic_field=_vector(flu(field)),
        magnetic_field_covariance=np.zeros(9),
    )


def pressure(frame: RosFrames, sample: PressureSample, utc_ns: int) -> Any:
    """Absolute; its variance is not known, which is 0."""
    return ros.sensor_msgs__msg__FluidPressure(
        header=_header(utc_ns, frame.at("pressure")), fluid_pressure=sample.pressure, variance=0.0
    )


def dvl(frame: RosFrames, sample: DvlSample, utc_ns: int) -> Any:
    """Nothing without a lock on the bottom."""
    if sample.velocity is None:
        return None
    velocity = frame.dvl.to_body(sample.velocity)
    twist = ros.geometry_msgs__msg__Twist(
        linear=_vector(flu(velocity)), angular=_vector((0.0, 0.0, 0.0))
    )
    covariance = _diagonal([sample.std * sample.std] * 3 + [UNKNOWN] * 3)
    return ros.geometry_msgs__msg__TwistWithCovarianceStamped(
        header=_header(utc_ns, frame.at("dvl")),
        twist=ros.geometry_msgs__msg__TwistWithCovariance(twist=twist, covariance=covariance),
    )


def battery(frame: RosFrames, sample: BatterySample, utc_ns: int) -> Any:
    """ROS counts current into the battery; what is not measured is not a number."""
    charge = sample.charge
    return ros.sensor_msgs__msg__BatteryState(
        header=_header(utc_ns, frame.base),
        voltage=sample.voltage,
        temperature=nan,
        current=nan if sample.current is None else -sample.current,
        charge=nan,
        capacity=nan,
        design_capacity=nan,
        percentage=nan if charge is None else min(1.0, max(0.0, charge)),
        power_supply_status=ros.sensor_msgs__msg__BatteryState.POWER_SUPPLY_STATUS_DISCHARGING,
        power_supply_health=ros.sensor_msgs__msg__BatteryState.POWER_SUPPLY_HEALTH_UNKNOWN,
        power_supply_technology=ros.sensor_msgs__msg__BatteryState.POWER_SUPPLY_TECHNOLOGY_UNKNOWN,
        present=True,
        cell_voltage=np.zeros(0, np.float32),
        cell_temperature=np.zeros(0, np.float32),
        location="",
        serial_number="",
    )


def _odometry(
    header: Any, child: str, place: Vec3, attitude: Quaternion, velocity: Vec3, rate: Vec3
) -> Any:
    """Without covariances. Place NED, attitude q_NB, velocity and rate FRD."""
    east, north, up = enu(place)
    return ros.nav_msgs__msg__Odometry(
        header=header,
        child_frame_id=child,
        pose=ros.geometry_msgs__msg__PoseWithCovariance(
            pose=ros.geometry_msgs__msg__Pose(
                position=ros.geometry_msgs__msg__Point(x=east, y=north, z=up),
                orientation=_quaternion(enu_from_flu(attitude)),
            ),
            covariance=np.zeros(36),
        ),
        twist=ros.geometry_msgs__msg__TwistWithCovariance(
            twist=ros.geometry_msgs__msg__Twist(
                linear=_vector(flu(velocity)), angular=_vector(flu(rate))
            ),
            covariance=np.zeros(36),
        ),
    )


def state_is_known(state: VehicleState) -> bool:
    return state.phase == "running" and state.depth.valid


def place_of(state: VehicleState) -> Vec3:
    """[m] NED; north and east are 0 where they are not known."""
    return _value(state.north), _value(state.east), state.depth.value


def odometry(frame: RosFrames, state: VehicleState, utc_ns: int) -> Any:
    """Heave comes from the depth rate, and from surge and sway as far as the vehicle is tilted."""
    if not state_is_known(state):
        return None
    surge, sway = _value(state.surge_velocity), _value(state.sway_velocity)
    x, y, z = down_in_body(state.attitude)
    steep = z < STEEPEST
    heave = 0.0 if steep else (_value(state.depth_rate) - x * surge - y * sway) / z
    sideways = _variance(state.surge_velocity), _variance(state.sway_velocity)
    of_heave = UNKNOWN
    if not steep:
        sum_of = _variance(state.depth_rate) + x * x * sideways[0] + y * y * sideways[1]
        of_heave = min(UNKNOWN, sum_of / (z * z))
    said = _odometry(
        _header(utc_ns, frame.odom),
        frame.base,
        place_of(state),
        from_north(state),
        (surge, sway, heave),
        (0.0, 0.0, _value(state.yaw_rate)),
    )
    heading = state.heading_navigation or state.heading
    said.pose.covariance = _diagonal(
        map(
            _variance,
            (state.east, state.north, state.depth, state.roll, state.pitch, heading),
        )
    )
    said.twist.covariance = _diagonal(
        (*sideways, of_heave, UNKNOWN, UNKNOWN, _variance(state.yaw_rate))
    )
    return said


def _placed(header: Any, child: str, place: Vec3, turned: Quaternion) -> Any:
    """A frame in that of the header, in whose axes `place` is."""
    placed = ros.geometry_msgs__msg__Transform(
        translation=_vector(place), rotation=_quaternion(turned)
    )
    return ros.geometry_msgs__msg__TransformStamped(
        header=header, child_frame_id=child, transform=placed
    )


def transform(frame: RosFrames, state: VehicleState, utc_ns: int) -> Any:
    """The drone's frame in that of its odometry."""
    if not state_is_known(state):
        return None
    turned = enu_from_flu(from_north(state))
    placed = _placed(_header(utc_ns, frame.odom), frame.base, enu(place_of(state)), turned)
    return ros.tf2_msgs__msg__TFMessage(transforms=[placed])


def mounted(frame: RosFrames, utc_ns: int) -> Any:
    """Where the sensors sit: their frames in the drone's."""
    header = _header(utc_ns, frame.base)
    return ros.tf2_msgs__msg__TFMessage(
        transforms=[_placed(header, at, flu(r), LEVEL) for at, r in frame.places.items()]
    )


def truth(frame: RosFrames, known: Truth, utc_ns: int) -> Any:
    """The truth of a simulator; exact, so its covariances are 0."""
    child = f"{frame.base}_truth"
    where = known.position, known.attitude, known.velocity, known.angular_rate
    return _odometry(_header(utc_ns, frame.odom), child, *where)


def _diagnostics(utc_ns: int, level: int, name: str, words: str, values: dict[str, object]) -> Any:
    pairs = [
        ros.diagnostic_msgs__msg__KeyValue(key=key, value="" if value is None else str(value))
        for key, value in values.items()
    ]
    status = ros.diagnostic_msgs__msg__DiagnosticStatus(
        level=level, name=name, message=words, hardware_id="", values=pairs
    )
    return ros.diagnostic_msgs__msg__DiagnosticArray(header=_header(utc_ns, ""), status=[status])


def vehicle_status(frame: RosFrames, status: VehicleStatus, utc_ns: int) -> Any:
    level = ERROR if status.failsafe != "none" else WARN if status.conditions else OK
    seen = vehicle_view(Newest(status=status), status.stamp_ns)
    name = frame.base.partition("/")[0]
    return _diagnostics(
        utc_ns,
        level,
        f"{name}: drone",
        acting(seen) or events.note(status.notices) or status.activity,
        {
            "activity": status.activity,
            "armed": status.armed,
            "flight mode": status.flight_mode,
            "failsafe": status.failsafe,
            "conditions": ", ".join(status.conditions),
            "pilot": status.pilot,
        },
    )


def service_health(frame: RosFrames, health: Health, utc_ns: int) -> Any:
    """Late is a warning; so is what was counted and is not normal in a dive, in words."""
    late = health.lateness_p99_ms is not None and health.lateness_p99_ms > LATE_MS
    words = "late" if late else "works"
    name = frame.base.partition("/")[0]
    return _diagnostics(
        utc_ns,
        WARN if late else OK,
        f"{name}: {health.service}",
        words,
        {
            "calls [1/s]": health.loop_hz,
            "lateness, 99 % [ms]": health.lateness_p99_ms,
            "CPU [%]": health.cpu_percent,
            "memory [MB]": health.rss_mb,
            **{f"{key}: {events.sentence(key)}": count for key, count in health.counts.items()},
        },
    )


def log_line(frame: RosFrames, line: LogLine, utc_ns: int) -> Any:
    """ROS names what a node logs by that node; file and line are nobody's business."""
    return ros.rcl_interfaces__msg__Log(
        stamp=_stamp(utc_ns),
        level=LEVELS[line.level],
        name=f"{frame.base.partition('/')[0]}.{line.service}",
        msg=line.text,
        file="",
        function="",
        line=0,
    )


# Sticks. `sensor_msgs/Joy` as joy's game_controller_node lays it out, and the sticks of Lindy's own
# pads: right hand surge and sway, left hand heave and yaw. ROS counts up and left as positive.
LEFT_X, LEFT_Y, RIGHT_X, RIGHT_Y = range(4)
UP, DOWN = 11, 12  # of the cross: the camera
BUTTONS: dict[int, Press] = {6: "arm", 4: "disarm", 1: "stop", 3: "light"}  # start, back, B, Y
NUMBERS = 15  # buttons of that layout


def heard_of(data: bytes, attached: Attachment) -> tuple[RosSticks, bool]:
    """Sticks of a node of ROS 2, and whether they were beyond a full stick.

    Args:
        data: CDR of a Joy.

    Raises:
        ValueError: it is no such message, or holds no sticks.
    """
    said = decoded(data, JOY)
    if len(axes := said.axes) <= RIGHT_Y or not all(map(isfinite, axes[: RIGHT_Y + 1])):
        raise ValueError(f"sticks need {RIGHT_Y + 1} axes that are numbers, found {axes}")
    down = {number for number, button in enumerate(said.buttons) if button}
    sticks = Sticks(
        surge=float(axes[RIGHT_Y]),
        sway=-float(axes[RIGHT_X]),
        heave=-float(axes[LEFT_Y]),
        yaw=-float(axes[LEFT_X]),
        tilt=float((UP in down) - (DOWN in down)),
    )
    within = Sticks(*(max(-1.0, min(1.0, each)) for each in sticks))
    pressed = frozenset[Press](BUTTONS[number] for number in down & BUTTONS.keys())
    return RosSticks(attached.publisher, attached.utc_ns, within, pressed), within != sticks


def joy(frame: RosFrames, command: PilotCommand, utc_ns: int) -> Any:
    """The pilot's sticks, whoever he is."""
    axes = np.zeros(6, np.float32)
    axes[RIGHT_Y], axes[RIGHT_X] = command.surge, -command.sway
    axes[LEFT_Y], axes[LEFT_X] = -command.heave, -command.yaw
    buttons = np.zeros(NUMBERS, np.int32)
    buttons[UP], buttons[DOWN] = command.tilt > 0.0, command.tilt < 0.0
    return ros.sensor_msgs__msg__Joy(header=_header(utc_ns, frame.base), axes=axes, buttons=buttons)


# The table.

Make = Callable[[RosFrames, Any, int], Any]


class RosRow(NamedTuple):
    """One topic of ROS 2, and what it is made of."""

    of: AnyTopic
    name: str  # within the drone's namespace; from a / on: the same for all drones
    kind: str
    make: Make


ROWS = (
    RosRow(topics.IMU, "imu/data_raw", "sensor_msgs/msg/Imu", imu),
    RosRow(topics.MAGNETOMETER, "imu/mag", "sensor_msgs/msg/MagneticField", magnetic_field),
    RosRow(topics.PRESSURE, "pressure", "sensor_msgs/msg/FluidPressure", pressure),
    RosRow(topics.DVL, "dvl", "geometry_msgs/msg/TwistWithCovarianceStamped", dvl),
    RosRow(topics.BATTERY, "battery", "sensor_msgs/msg/BatteryState", battery),
    RosRow(topics.STATE, "odom", "nav_msgs/msg/Odometry", odometry),
    RosRow(topics.STATE, "/tf", "tf2_msgs/msg/TFMessage", transform),
    RosRow(topics.TRUTH, "truth", "nav_msgs/msg/Odometry", truth),
    RosRow(topics.PILOT_COMMAND, "sticks", JOY, joy),
    RosRow(topics.STATUS, "/diagnostics", "diagnostic_msgs/msg/DiagnosticArray", vehicle_status),
    RosRow(topics.HEALTH, "/diagnostics", "diagnostic_msgs/msg/DiagnosticArray", service_health),
    RosRow(topics.LOG, "/rosout", "rcl_interfaces/msg/Log", log_line),
)
MADE = defaultdict[str, list[RosRow]](list)
for _row in ROWS:
    MADE[_row.of.key].append(_row)
PICTURE = "sensor_msgs/msg/CompressedImage"
H264, JPEG = "h264", "jpeg"  # formats of pictures
ENDS = {H264: "h264", JPEG: "compressed"}  # of their topics; the second as image_transport has it
STICKS = "joy"  # topic from which sticks are taken


class RosMessage(NamedTuple):
    topic: str  # its whole name
    kind: str
    made: Any  # of that type, as rosbags has it

    def cdr(self) -> bytes:
        """
        Raises:
            ValueError: a value has no room in its field, such as a time after 2038 or 1e99 V.
        """
        try:
            return bytes(STORE.serialize_cdr(self.made, self.kind))
        except Exception as error:  # of whatever kind, as for what is read
            raise ValueError(f"{self.topic}: {error}") from None


class RosTopic(NamedTuple):
    name: str
    kind: str


class ToJpeg(Protocol):
    """Decodes the pictures of one camera."""

    def take(self, unit: AccessUnit) -> bytes | None: ...
    def forget(self) -> None: ...


class RosMessages:
    """Messages of one drone. Pictures come in parts, so it has a memory of each camera's newest."""

    def __init__(
        self,
        name: str,
        namespace: str,
        mounting: Mounting | None,
        jpegs: Callable[[], ToJpeg] | None = None,
    ) -> None:
        """
        Args:
            namespace: empty, or from a / on.
            mounting: of the sensors; None: not known, as if they had the body's axes.
            jpegs: makes what decodes the pictures of one camera; None: there are none as JPEG.
        """
        self._frame, self._namespace = frames_of(name, mounting), namespace
        self._pictures = defaultdict[str, Assembler](Assembler)
        self._jpegs = None if jpegs is None else defaultdict[str, ToJpeg](jpegs)

    def whole(self, name: str) -> str:
        return name if name.startswith("/") else f"{self._namespace}/{name}"

    def offered(self, of_cameras: Iterable[str]) -> list[RosTopic]:
        """Every topic of a drone with these cameras."""
        found = [RosTopic(self.whole(row.name), row.kind) for row in ROWS]
        formats = (H264,) if self._jpegs is None else (H264, JPEG)
        named = (self._camera(camera, each) for camera in of_cameras for each in formats)
        return list(dict.fromkeys([*found, *(RosTopic(name, PICTURE) for name in named)]))

    def static(self, utc_ns: int) -> RosMessage | None:
        """What is so for the whole dive: where the sensors sit. None: that is not known."""
        if not self._frame.places:
            return None
        return RosMessage("/tf_static", "tf2_msgs/msg/TFMessage", mounted(self._frame, utc_ns))

    def has(self, topic: AnyTopic) -> bool:
        """Do its messages become anything in ROS 2?"""
        return topic.message is VideoPart or topic.key in MADE

    def of(
        self,
        topic: AnyTopic,
        key: str,
        message: Message,
        utc_ns: int,
        wanted: Callable[[str], bool] = lambda _: True,
    ) -> Iterator[RosMessage]:
        """What one message of the bus is in ROS 2.

        Args:
            topic, key: its row of the topic table, and its own key.
            utc_ns: [ns] UTC of its stamp.
            wanted: does anybody hear a topic of ROS 2 by this name?
        """
        if isinstance(message, VideoPart):
            yield from self._picture(key, message, utc_ns, wanted)
            return
        for row in MADE.get(topic.key, ()):
            name = self.whole(row.name)
            if wanted(name) and (made := row.make(self._frame, message, utc_ns)) is not None:
                yield RosMessage(name, row.kind, made)

    def _camera(self, camera: str, form: str) -> str:
        base = "camera" if camera == cameras.FIRST else f"camera_{camera}"
        return self.whole(f"{base}/{ENDS[form]}")

    def _picture(
        self, key: str, part: VideoPart, utc_ns: int, wanted: Callable[[str], bool]
    ) -> Iterator[RosMessage]:
        """An access unit of H.264 as it is, where a keyframe begins with its parameter sets; and
        its picture as JPEG."""
        unit = self._pictures[key].take(part)
        if unit is None:
            return
        camera = cameras.camera_of(key) or cameras.FIRST
        if wanted(name := self._camera(camera, H264)):
            yield self._compressed(name, H264, unit.data, utc_ns)
        if self._jpegs is None:
            return
        if not wanted(name := self._camera(camera, JPEG)):
            self._jpegs[key].forget()
        elif (picture := self._jpegs[key].take(unit)) is not None:
            yield self._compressed(name, JPEG, picture, utc_ns)

    def _compressed(self, name: str, form: str, data: bytes, utc_ns: int) -> RosMessage:
        made = ros.sensor_msgs__msg__CompressedImage(
            header=_header(utc_ns, self._frame.base),
            format=form,
            data=np.frombuffer(data, np.uint8),
        )
        return RosMessage(name, PICTURE, made)


def type_hash(kind: str) -> str:
    """RIHS01 of a type, from its description (REP 2016)."""
    return STORE.hash_rihs01(kind)


def decoded(data: bytes, kind: str) -> Any:
    """
    Raises:
        ValueError: it is no CDR of this type.
    """
    try:
        return STORE.deserialize_cdr(data, kind)
    except Exception as error:  # of whatever kind: where bytes are wrong, rosbags does not say
        raise ValueError(f"no {kind}: {error}") from None
