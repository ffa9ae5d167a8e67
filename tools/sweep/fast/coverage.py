"""What `lindy sweep --fast` knows, and the sentence with which all else is refused."""

from collections.abc import Sequence
from typing import NoReturn

from messages import topics
from services.gamepad import stick_log
from services.gamepad.io.path_file import course_named
from services.gamepad.stick_log import StickLog
from services.marine.calibration import SensorCalibration
from services.marine.mounting import Mounting
from services.marine.vehicle import Vehicle
from services.piloting.pilot_intents import OutputIntent
from services.runtime.config.errors import LindyError
from services.runtime.config.settings import deploy_file
from services.simulator.settings import Settings
from services.tether.delay import Trace
from services.tether.profile import NO_OUTAGES, DirectionProfile
from tools.sweep.fast.dives import DiveSettings

STACK = "simulated"
TABLES = ("vehicle", "sensors", "simulator", "estimation", "reference", "control")
UNKNOWN_KEYS = ("estimation.watch", "reference.failsafe", "reference.place", "control.adaptation")
KNOWN_KEYS = ("reference.failsafe.depth_limit",)
WITHOUT_EFFECT = ("light", "light_2", "laser")  # events of a script, on the motion
SHORTEST = 1.5  # [s] of the calibration; sooner the sensors have not been judged
SITE = ("terrain", "current", "hull", "waves", "sensor_errors", "vibration")


def script_of(pilot: str) -> StickLog:
    """Of a pilot that has been checked."""
    path = deploy_file("dives", pilot.partition(":")[2], ".csv")
    return stick_log.parse(path.read_bytes(), course_named)


def require_covered(settings: DiveSettings, stack: str, keys: Sequence[str], link: str) -> None:
    """
    Args:
        stack: name of the stack.
        keys: those of --set.
        link: name of the profile.

    Raises:
        LindyError: the arrays do not know this; names it and what they know.
    """
    s = settings
    if stack != STACK:
        _refuse(f"--stack {stack}", f"the stack {STACK}")
    for key in keys:
        known = key.partition(".")[0] in TABLES and not key.startswith(UNKNOWN_KEYS)
        if not known and key not in KNOWN_KEYS:
            _refuse(
                f"--set {key}", f"keys of {', '.join(TABLES)} without {', '.join(UNKNOWN_KEYS)}"
            )
    _require_plain_site(s.simulator)
    _require_plain_vehicle(s.vehicle, s.simulator.mounting)
    if (still := s.estimation.calibration.still_time) < SHORTEST:
        _refuse(f"estimation.calibration.still_time = {still:g}", f"{SHORTEST:g} s and more")
    for name, gains in (("depth", s.control.depth), ("heading", s.control.heading)):
        if gains.observer == 0.0:
            _refuse(f"control.{name}.observer = 0", "axes with a disturbance observer")
    for side, leg in (("down", s.link.down), ("up", s.link.up)):
        _require_delay(link, side, leg)
    _require_sticks(s.script)


def _require_plain_site(place: Settings) -> None:
    for name in SITE:
        if getattr(place, name) is not None:
            _refuse(f"simulator.{name}", "still water and sensors and hulls as in their files")
    if place.imu_rate != topics.IMU.hz:
        _refuse(f"simulator.imu_rate = {place.imu_rate:g}", f"{topics.IMU.hz:g}")
    if place.stamp_jitter:
        _refuse(f"simulator.stamp_jitter = {place.stamp_jitter:g}", "0")


def _require_sticks(script: StickLog) -> None:
    for row in script.rows:
        known = row.event in WITHOUT_EFFECT or isinstance(row.event, OutputIntent)
        if row.event is not None and not known:
            _refuse(
                f"the event {_named(row.event)} at {row.at_ns / 1e9:g} s of the script",
                f"sticks, {', '.join(WITHOUT_EFFECT)} and output",
            )


def _require_plain_vehicle(vehicle: Vehicle, mounting: Mounting | None) -> None:
    if vehicle.mounting != Mounting() or mounting not in (None, Mounting()):
        _refuse("a mounting of the sensors", "sensors at the origin, along the body's axes")
    if vehicle.calibration != SensorCalibration():
        _refuse("vehicle.calibration", "sensors that need none")


def _require_delay(name: str, side: str, leg: DirectionProfile) -> None:
    """A link that is a delay, and nothing else."""
    found = {
        "delay": isinstance(leg.delay, Trace),
        "loss": leg.loss is not None,
        "late": leg.late is not None,
        "duplicate": leg.duplicate > 0.0,
        "corrupt": leg.corrupt > 0.0,
        "rate_kbit": leg.rate_kbit > 0.0,
        "outages": leg.outages != NO_OUTAGES,
    }
    for key, there in found.items():
        if there:
            _refuse(f"{side}.{key} of the link {name}", "links that only delay, by their mean")


def _named(event: object) -> str:
    if isinstance(event, str):
        return event
    return type(event).__name__.removesuffix("Intent").removesuffix("Request").lower()


def _refuse(what: str, known: str) -> NoReturn:
    raise LindyError(f"--fast does not know {what}; it knows {known}. Leave out --fast for this")
