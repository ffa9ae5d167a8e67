"""Real dives on record: which logs of a folder are known, and the estimator over one of them.

Known are the bags of ExjobbROV (github.com/MrEkelund/ExjobbROV, a BlueROV of 2014 in a pool), whose
names end in the second at which they began, and small.BIN and small.tlog, logs of ArduSub. Where
that second is even, settings may be chosen with a bag; where it is odd, it judges them. Nothing is
fetched.
"""

import re
import time
from collections.abc import Sequence
from math import sqrt
from pathlib import Path
from typing import Literal, NamedTuple, TypeVar

import msgspec
import numpy as np
from msgspec.structs import replace

from lindy.api import LindyError
from lindy.api.dives import Stack
from lindy.api.messages import (
    AidSource,
    ImuSample,
    MagnetometerSample,
    PressureSample,
    Vec3,
    VehicleEstimate,
    VehicleState,
    events,
    topics,
)
from lindy.api.vehicle import GRAVITY, Vehicle
from lindy_research.bench.reality_smoother import REST_SAMPLES, Floats, Smoothed, smoothed
from messages.events import Outbox
from messages.units import Ns
from services.estimation.core import Estimator
from services.estimation.settings import Settings
from services.marine.mounting import Mounting
from tools.importing.command import opened
from tools.importing.conversion import Conversion, Imported
from tools.importing.log_file import chosen
from tools.importing.map_file import read_map

M = TypeVar("M")
Part = Literal["even", "odd", "others"]
BAG = re.compile(r".*_\d{4}-\d\d-\d\d-\d\d-\d\d-(\d\d)\.bag")
OTHERS = ("small.BIN", "small.tlog")
BAG_MAP = "rovio"
# What a file of this vehicle would say, by the likelihood of the pressure's innovations in even
# seconds (range -0.25 … -0.15 m, 0.03 … 0.06 s; up or down by 0.05 m is less likely by far).
BAG_ARM: Vec3 = (-0.2, 0.0, 0.0)  # [m] FRD of the pressure sensor in its hull, from the IMU
BAG_LATENCY = 0.04  # [s] of the pressure: half of the time from one sample to the next
FRESH_WATER = 1000.0  # [kg/m³]
PRESSURE_STD = 200.0  # [Pa] 2 mbar
LEAST_RATE = 15.0  # [1/s] of an IMU, that an attitude is asked of
MOST_RATE = 100.0  # [1/s] that may be declared
SETTLED_S = 3.0  # [s] after the estimator's start
LEAST_STATES, LEAST_INNOVATIONS = 5, 20
LEAST_VARIANCE = 1e-6  # [m²] of the depth without its datum
FAST_ROLL, FAST_PITCH = 1.5, 1.2  # [rad] beyond which roll says little: the vehicle stands on end


class KnownLog(NamedTuple):
    path: Path
    part: Part


class OwnErrors(NamedTuple):
    """Of what the vehicle itself estimated on the way."""

    roll: float | None  # [rad] rms; None: it is not on record
    pitch: float | None  # [rad] rms
    depth: float | None  # [m] rms, less its median


class LoggedDive(NamedTuple):
    """One log. Errors are against the smoother's; None: cannot be said."""

    name: str
    part: Part
    unusable: str  # why nothing else is known; empty: it was judged
    imu_rate: float = 0.0  # [1/s]
    import_s: float = 0.0  # [s] reading and conversion
    seconds: float = 0.0  # [s] length
    thrown_away: float = 0.0  # [-] share of the IMU samples on record that no state came of
    cpu: float = 0.0  # [s] of an IMU sample, with the others that came meanwhile
    start: float | None = None  # [s] until it was running; None: never
    attitude: float = 0.0  # [-] share of the running states that have one
    inconsistent: bool = False  # the IMU with the other sensors, at any time
    noisy: bool = False  # the IMU
    on_end: bool = False  # roll and pitch went beyond FAST_ROLL or FAST_PITCH
    roll: float | None = None  # [rad] rms
    pitch: float | None = None  # [rad] rms
    depth: float | None = None  # [m] rms, less its median: the air pressure is not on record
    depth_rate: float | None = None  # [m/s] rms
    nees_depth: float | None = None  # [-] without what the estimator says of the air pressure
    nees_rate: float | None = None  # [-]
    nees_tilt: float | None = None  # [-] mean of roll and pitch
    rho: float | None = None  # [-] correlation of each innovation of the pressure with the next
    own: OwnErrors = OwnErrors(None, None, None)


def known(folder: Path) -> tuple[list[KnownLog], list[str]]:
    """The known logs of a folder, and the names of its other files.

    Raises:
        LindyError: there is no such folder, or none in it is known.
    """
    if not folder.is_dir():
        raise LindyError(f"LINDY_REAL={folder}: there is no such folder")
    found, unknown = list[KnownLog](), list[str]()
    for path in sorted(folder.iterdir()):
        if match := BAG.fullmatch(path.name):
            found.append(KnownLog(path, "odd" if int(match[1]) % 2 else "even"))
        elif path.name in OTHERS:
            found.append(KnownLog(path, "others"))
        else:
            unknown.append(path.name)
    if not found:
        raise LindyError(
            f"LINDY_REAL={folder}: none of its {len(unknown)} files is known; expected bags of "
            f"ExjobbROV, named …_2016-05-25-09-17-38.bag, or {' or '.join(OTHERS)}"
        )
    return found, unknown


def judged(log: KnownLog) -> LoggedDive:
    """One log, read and given to a new estimator."""
    name, part = log.path.name, log.part
    try:
        began = time.process_time()
        rows, imu_rows, vehicle = _read(log)
        import_s = time.process_time() - began
    except LindyError as error:
        return LoggedDive(name, part, str(error).replace(str(log.path), name))
    imu = _increasing(_of(rows, ImuSample))
    pressures = _of(rows, PressureSample)
    if len(imu) < REST_SAMPLES or not pressures:
        return LoggedDive(name, part, f"{len(imu)} IMU and {len(pressures)} pressure samples")
    seconds = (imu[-1].stamp_ns - imu[0].stamp_ns) * 1e-9
    rate = (len(imu) - 1) / seconds
    if rate < LEAST_RATE:
        return LoggedDive(name, part, f"{rate:.0f} IMU samples a second")
    latency = 0.0 if part == "others" else BAG_LATENCY
    run = _run(rows, vehicle, seconds, latency)
    dive = LoggedDive(
        *(name, part, ""),
        imu_rate=rate,
        import_s=import_s,
        seconds=seconds,
        thrown_away=1.0 - run.used / imu_rows,
        cpu=run.cpu / len(imu),
    )
    arm = vehicle.mounting.pressure.position
    reference = smoothed(imu, pressures, arm, latency, FRESH_WATER)
    return _compared(dive, run, reference, _of(rows, VehicleEstimate))


def _of(rows: Sequence[Imported], kind: type[M]) -> list[M]:
    return [row.message for row in rows if isinstance(row.message, kind)]


def _increasing(imu: Sequence[ImuSample]) -> list[ImuSample]:
    found = list[ImuSample]()
    for sample in imu:
        if not found or sample.stamp_ns > found[-1].stamp_ns:
            found.append(sample)
    return found


def _read(log: KnownLog) -> tuple[list[Imported], int, Vehicle]:
    """Its messages, how many rows of its IMU it has, and the vehicle.

    Raises:
        LindyError: the log cannot be used.
    """
    file = opened(log.path)
    wanted, _ = read_map(file.default_map if log.part == "others" else BAG_MAP)
    sources = file.sources()
    taken = chosen(wanted, sources, str(log.path))
    messages = [*Conversion(file.rows(taken), taken, None, file.getter).messages()]
    of_imu = [s for s, several in taken.items() if any(m.as_ == topics.IMU.key for m in several)]
    vehicle = Stack(vehicle=wanted.vehicle).section("vehicle", Vehicle)
    if log.part != "others":
        # The position of its IMU was not measured.
        mounting = Mounting(pressure=replace(vehicle.mounting.pressure, position=BAG_ARM))
        vehicle = replace(vehicle, mounting=mounting)
    return messages, sum(sources[source].messages for source in of_imu), vehicle


# The estimator.


class Run(NamedTuple):
    states: list[VehicleState]
    datum: Floats  # [m] 1σ of the depth that is the air pressure's, with each state
    pressure: list[AidSource]
    counts: dict[str, int]
    used: int  # IMU samples
    cpu: float  # [s]


def _run(rows: Sequence[Imported], vehicle: Vehicle, seconds: float, latency: float) -> Run:
    outbox, cpu, used = Outbox(), 0, 0
    estimator = Estimator(_settings(rows, seconds, latency), 0.0, None, vehicle, outbox)
    states, datum, pressure = list[VehicleState](), list[float](), list[AidSource]()
    per_metre = FRESH_WATER * GRAVITY  # [Pa/m]
    for _, message, at in rows:
        began = time.process_time_ns()
        state, aiding = _step(estimator, message, at)
        cpu += time.process_time_ns() - began
        pressure += aiding
        if state is None or not isinstance(message, ImuSample):
            continue
        used += state.sensor_ns == message.stamp_ns
        kept = estimator.checkpoint(at)
        states.append(state)
        datum.append(kept.atmosphere_std / per_metre if kept else 0.0)
    return Run(states, np.array(datum), pressure, dict(outbox.counts), used, cpu * 1e-9)


def _step(
    estimator: Estimator, message: object, at: Ns
) -> tuple[VehicleState | None, list[AidSource]]:
    """The state, and what was made of the pressure."""
    if isinstance(message, ImuSample):
        state = estimator.imu(message, at)
        return state, [a for name, a in estimator.aid_sources(at) if name == "pressure"]
    if isinstance(message, PressureSample):
        estimator.pressure(message)
    elif isinstance(message, MagnetometerSample):
        estimator.magnetometer(message)
    return None, []


def _settings(rows: Sequence[Imported], seconds: float, latency: float) -> Settings:
    """As shipped, but for water, pressure sensor and rates, which a vehicle file would say."""

    def rate(kind: type[object], least: float = 1.0, most: float = MOST_RATE) -> float:
        return max(least, min(most, len(_of(rows, kind)) / seconds))

    return msgspec.convert(
        {
            "water_density": FRESH_WATER,
            "depth": {"pressure_std": PRESSURE_STD, "pressure_latency": latency},
            "watch": {
                "imu_rate": rate(ImuSample, 10.0, 400.0),
                "pressure_rate": rate(PressureSample),
                "magnetometer_rate": rate(MagnetometerSample),
            },
        },
        Settings,
    )


# Beside the smoother.


def _compared(
    dive: LoggedDive, run: Run, reference: Smoothed, own: Sequence[VehicleEstimate]
) -> LoggedDive:
    running = [n for n, state in enumerate(run.states) if state.phase == "running"]
    counts = run.counts
    dive = dive._replace(
        inconsistent=events.INCONSISTENT_IMU.name in counts,
        noisy=events.NOISY(topics.IMU.key).name in counts,
        on_end=bool(
            np.abs(reference.roll).max() > FAST_ROLL or np.abs(reference.pitch).max() > FAST_PITCH
        ),
        own=_own(own, reference),
    )
    if not running:
        return dive
    begin_ns = run.states[running[0]].sensor_ns
    late_ns = begin_ns + round(SETTLED_S * 1e9)
    late = [n for n in running if run.states[n].sensor_ns > late_ns]
    roll, roll_share = _error(run, late, reference, "roll")
    pitch, pitch_share = _error(run, late, reference, "pitch")
    depth, depth_share = _error(run, late, reference, "depth")
    depth_rate, rate_share = _error(run, late, reference, "depth_rate")
    tilt = None if roll_share is None or pitch_share is None else (roll_share + pitch_share) / 2.0
    return dive._replace(
        start=(begin_ns - reference.first_ns) * 1e-9,
        attitude=float(np.mean([run.states[n].roll.valid for n in running])),
        roll=roll,
        pitch=pitch,
        depth=depth,
        depth_rate=depth_rate,
        nees_depth=depth_share,
        nees_rate=rate_share,
        nees_tilt=tilt,
        rho=_whiteness(run.pressure, late_ns),
    )


def _error(
    run: Run, late: Sequence[int], reference: Smoothed, name: str
) -> tuple[float | None, float | None]:
    """RMS of the valid estimates, and their mean squared error over stated variance."""
    valid = [n for n in late if getattr(run.states[n], name).valid]
    if len(valid) < LEAST_STATES:
        return None, None
    each = [getattr(run.states[n], name) for n in valid]
    truth = reference.at(name, [run.states[n].sensor_ns for n in valid])
    off = np.array([e.value for e in each]) - truth
    variance = np.array([e.std for e in each]) ** 2
    if name == "depth":
        off -= np.median(off)
        variance = np.maximum(LEAST_VARIANCE, variance - run.datum[valid] ** 2)
    else:
        off = _wrapped(off)
    return _rms(off), float(np.mean(off * off / variance))


def _own(estimates: Sequence[VehicleEstimate], reference: Smoothed) -> OwnErrors:
    """Of the vehicle's own filter, from the same moment on in every log."""
    begin_ns = reference.first_ns + round(2.0 * SETTLED_S * 1e9)
    end_ns = reference.first_ns + round(reference.t[-1] * 1e9)

    def error(name: str) -> float | None:
        known = [
            (e.stamp_ns, value)
            for e in estimates
            if begin_ns < e.stamp_ns < end_ns and (value := getattr(e, name)) is not None
        ]
        if len(known) < LEAST_STATES:
            return None
        off = np.array([v for _, v in known]) - reference.at(name, [at for at, _ in known])
        return _rms(off - np.median(off) if name == "depth" else _wrapped(off))

    return OwnErrors(error("roll"), error("pitch"), error("depth"))


def _whiteness(pressure: Sequence[AidSource], late_ns: int) -> float | None:
    """ρ of the normalised innovations, one sample later."""
    shares = np.array(
        [
            a.innovation / sqrt(a.variance)
            for a in pressure
            if a.innovation is not None and a.variance and a.stamp_ns > late_ns
        ]
    )
    if len(shares) <= LEAST_INNOVATIONS:
        return None
    return float(np.mean(shares[1:] * shares[:-1]) / np.mean(shares * shares))


def _wrapped(angle: Floats) -> Floats:
    return (angle + np.pi) % (2.0 * np.pi) - np.pi


def _rms(errors: Floats) -> float:
    return float(np.sqrt(np.mean(errors * errors)))
