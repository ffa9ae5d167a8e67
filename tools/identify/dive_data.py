"""What a dive's recording says of motion and thrust: windows in which a fit can use it."""

from collections import Counter
from collections.abc import Sequence
from math import hypot
from pathlib import Path
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from messages import topics
from messages.control import ThrusterCommand
from messages.message import Message
from messages.sensors import ImuSample, PressureSample
from messages.state import VehicleState
from messages.vehicle import Actuation
from services.control.allocation import effect_matrix
from services.marine.vehicle import GRAVITY, Vehicle
from services.marine.water import Density, density_of
from services.runtime.config.errors import LindyError
from services.vehicle.mounting import AtOrigin
from tools.identify.motion_model import ROWS, CommandedThrust, Floats
from tools.recordings.recording import Recording
from tools.replay.on_board import states_of_today
from tools.replay.source import IMPORTED

WINDOW_S = 10.0  # [s] one open-loop prediction of the fit
REST_S = 2.0  # [s] before arming at least, for the gyroscopes' bias
LONGEST_REST_S = 20.0  # [s] of it that are used
SILENT_S = 0.1  # [s] a longer pause of commands or samples ends a window
NEAR_LIMIT = 0.99  # [-] of a thruster's limit: its thrust is not known there
CLEAR = 0.15  # [m] of water above hull and propellers
FEWEST = 200  # samples that a stream must have
KEYS = {
    topic.key
    for topic in (
        topics.IMU, topics.PRESSURE, topics.STATE, topics.THRUSTERS, topics.ACTUATION,
    )
}  # fmt: skip
NO_SAMPLES = "has too few samples to identify anything"


class DiveData(NamedTuple):
    """Arrays over samples, each with its times [s] by the drone's clock."""

    imu_t: Floats
    rate: Floats  # (n, 3) [rad/s] FRD, without the bias at rest
    force: Floats  # (n, 3) [m/s²] specific force at the origin
    pressure_t: Floats
    below: Floats  # (k,) [m] pressure as a depth; the surface is not known
    state_t: Floats
    state: Floats  # (j, 7) roll, pitch, depth, depth rate, yaw rate, surge and sway velocity
    command_t: Floats
    commands: Floats  # (i, thrusters) [N]
    armed: NDArray[np.bool_]  # (i,)
    wander: float  # [rad/√s] of the angle that the gyroscopes' noise adds up to
    thrust_t: Floats
    thrust: Floats  # (l, thrusters) [N] measured; empty: it is not


class Windows(NamedTuple):
    """Windows of the same length: arrays (windows, n, …) over a grid of times."""

    period: float  # [s]
    t: Floats  # (windows, n) [s]
    rates: Floats  # (windows, n, 3) [rad/s]
    force: Floats  # (windows, n, 3) [m/s²]
    down: Floats  # (windows, n, 3) [-] the world's down axis in body axes
    tilted: Floats  # (windows, n, 3, 2) [-] its change per tilt at the begin about two axes [rad]
    begin: Floats  # (windows, 4) surge, sway, heave velocity, yaw rate as estimated then
    depth_t: list[Floats]  # per window [s] from its begin
    depth: list[Floats]  # per window [m] of the origin, from an unknown height
    refused: Counter[str]  # samples that are in no window, by reason


def read(recording: Recording, vehicle: Vehicle, density: Density, name: Path) -> DiveData:
    """
    Raises:
        LindyError: a stream is missing, or the time before arming is.
    """
    rows: dict[str, list[tuple[float, ...]]] = {key: [] for key in KEYS}
    origin = AtOrigin(vehicle.mounting, 1000.0, vehicle.calibration)
    newest: dict[str, int] = {}
    for raw in recording.raw(KEYS.__contains__):
        if (message := recording.decode(raw)) is None:
            continue
        stamp: int = message.sensor_ns if isinstance(message, VehicleState) else message.stamp_ns
        if raw.key in newest and stamp <= newest[raw.key]:
            continue
        if numbers := _numbers(message, origin, len(vehicle.thruster)):
            newest[raw.key] = stamp
            rows[raw.key].append((stamp * 1e-9, *numbers))
    if not rows[topics.STATE.key] and IMPORTED in recording.metadata("dive"):
        found = ((state.sensor_ns, _numbers(state, origin, 0)) for state in states_of_today(name))
        rows[topics.STATE.key] = [(at * 1e-9, *numbers) for at, numbers in found if numbers]
    for topic in (topics.IMU, topics.PRESSURE, topics.STATE, topics.THRUSTERS):
        if len(rows[topic.key]) < FEWEST:
            raise LindyError(
                f"{name} {NO_SAMPLES}: {len(rows[topic.key])} of {topic.key} that fit this vehicle,"
                f" expected at least {FEWEST}"
            )
    imu, pressure, state, commands = (
        np.array(rows[topic.key])
        for topic in (topics.IMU, topics.PRESSURE, topics.STATE, topics.THRUSTERS)
    )
    actuation = np.array(rows[topics.ACTUATION.key] or np.zeros((0, len(vehicle.thruster) + 1)))
    armed = commands[:, 1] > 0.0
    rest = _rest(imu, float(commands[np.argmax(armed), 0]) if np.any(armed) else None, name)
    wander = float(rest.std(axis=0)[:2].max() * np.sqrt(np.median(np.diff(imu[:, 0]))))
    per_metre = density_of(density) * GRAVITY
    return DiveData(
        imu[:, 0], imu[:, 1:4] - rest.mean(axis=0), imu[:, 4:7],
        pressure[:, 0], pressure[:, 1] / per_metre,
        state[:, 0], state[:, 1:], commands[:, 0], commands[:, 2:], armed,
        wander,        actuation[:, 0], actuation[:, 1:],
    )  # fmt: skip


def _numbers(message: Message, origin: AtOrigin, thrusters: int) -> tuple[float, ...]:
    """Empty: the message cannot be used."""
    match message:
        case ImuSample():
            sample = origin.imu(message)
            return *sample.angular_rate, *sample.specific_force
        case PressureSample():
            return (message.pressure,)
        case VehicleState() if message.roll.valid and message.pitch.valid and message.depth.valid:
            aids = message.surge_velocity, message.sway_velocity
            u, v = (0.0 if aid is None or not aid.valid else aid.value for aid in aids)
            s = message
            return (
                s.roll.value, s.pitch.value, s.depth.value, s.depth_rate.value, s.yaw_rate.value,
                u, v,
            )  # fmt: skip
        case ThrusterCommand() if len(message.thrust) == thrusters:
            return float(message.armed), *message.thrust
        case Actuation() if message.measured and len(message.thrust) == thrusters:
            return message.thrust
        case _:
            return ()


def _rest(imu: Floats, armed_at: float | None, name: Path) -> Floats:
    """(n, 3) [rad/s] Angular rate at rest, before the drone was armed."""
    if armed_at is None:
        raise LindyError(f"{name}: the drone was never armed, so its thrusters moved nothing")
    rest = imu[(imu[:, 0] < armed_at) & (imu[:, 0] > armed_at - LONGEST_REST_S)]
    if len(rest) < 2 or rest[-1, 0] - rest[0, 0] < REST_S:
        raise LindyError(
            f"{name} does not hold the {REST_S:g} s before arming, in which the drone is at rest"
            " and shows the bias of its gyroscopes"
        )
    return rest[:, 1:4]


def windows(data: DiveData, vehicle: Vehicle, seconds: float = WINDOW_S) -> Windows:
    """Every window of this length in which the drone is armed, under water, and no thruster is at
    its limit. There may be none."""
    period = float(np.median(np.diff(data.imu_t)))
    n = round(seconds / period) // 2 * 2
    usable, refused = _usable(data, vehicle)
    begins: list[int] = []
    for first, last in _spans(usable):
        begins += range(first, last - n + 1, n)
    t = data.imu_t[begins][:, None] + times(n, period)
    rates, force = columns_at(t, data.imu_t, data.rate), columns_at(t, data.imu_t, data.force)
    down, tilted = _down(data, t, rates, period)
    state = columns_at(t[:, :1], data.state_t, data.state)[:, 0]
    depth_t, depth = list[Floats](), list[Floats]()
    arm = np.array(vehicle.mounting.pressure.position)
    for number in range(len(t)):
        row = t[number]
        inside = (data.pressure_t >= row[0]) & (data.pressure_t < row[-1])
        since: Floats = data.pressure_t[inside] - row[0]
        lower: Floats = columns_at(since, row - row[0], down[number] @ arm[:, None])[:, 0]
        depth_t.append(since)
        depth.append(data.below[inside] - lower)
    begin = np.stack([state[:, 5], state[:, 6], state[:, 3], state[:, 4]], axis=-1)
    return Windows(period, t, rates, force, down, tilted, begin, depth_t, depth, refused)


def _usable(data: DiveData, vehicle: Vehicle) -> tuple[NDArray[np.bool_], Counter[str]]:
    """For every IMU sample; and why not, counted in samples."""
    t = data.imu_t
    index = np.clip(np.searchsorted(data.command_t, t, side="right") - 1, 0, None)
    limits = np.array([thruster.limits for thruster in vehicle.thruster])
    at_limit = np.any(
        (data.commands <= NEAR_LIMIT * limits[:, 0]) | (data.commands >= NEAR_LIMIT * limits[:, 1]),
        axis=1,
    )
    reach = max([vehicle.size[2] / 2, *(hypot(*t.position) for t in vehicle.thruster)])
    wet = columns_at(t, data.state_t, data.state[:, 2:3])[:, 0] > reach + CLEAR
    gap = np.diff(t, append=t[-1] + 1.0) > SILENT_S
    state = np.searchsorted(data.state_t, t).clip(0, len(data.state_t) - 1)
    silent = np.abs(data.state_t[state] - t) > SILENT_S
    reasons = {
        "not armed": ~data.armed[index],
        "without commands": (t - data.command_t[index] > SILENT_S) | (t < data.command_t[0]),
        "without samples": gap | silent,
        "not deep enough under water": ~wet,
        "with a thruster at its limit": at_limit[index],
    }
    usable, refused = np.ones(len(t), dtype=bool), Counter[str]()
    for reason, wrong in reasons.items():
        refused[reason] += int(np.sum(wrong & usable))
        usable &= ~wrong
    return usable, refused


def _spans(usable: NDArray[np.bool_]) -> Sequence[tuple[int, int]]:
    """First and one after the last index of each run."""
    edges = np.flatnonzero(np.diff(np.concatenate([[False], usable, [False]]).astype(int)))
    return [(int(a), int(b)) for a, b in edges.reshape(-1, 2)]


def times(n: int, period: float) -> Floats:
    """(n,) [s] From zero."""
    return np.linspace(0.0, (n - 1) * period, n)


def columns_at(t: Floats, known_t: Floats, known: Floats) -> Floats:
    """(…, k) Columns of `known` (m, k) between samples."""
    columns: list[Floats] = [np.interp(t, known_t, known[:, n]) for n in range(known.shape[1])]
    return np.stack(columns, axis=-1)


def _down(data: DiveData, t: Floats, rates: Floats, period: float) -> tuple[Floats, Floats]:
    """(windows, n, 3) The down axis, integrated from the angular rate, because the accelerometer
    takes acceleration for tilt; on average over a window it is as estimated. And its derivative by
    a tilt at the begin."""
    tilt = columns_at(t, data.state_t, data.state[:, :2])
    roll, pitch = tilt[..., 0], tilt[..., 1]
    estimated = np.stack(
        [-np.sin(pitch), np.cos(pitch) * np.sin(roll), np.cos(pitch) * np.cos(roll)], axis=-1
    )
    found = _integrated(estimated[:, 0], rates, period)
    begin = estimated[:, 0] + (estimated - found).mean(axis=1)
    begin /= np.linalg.norm(begin, axis=-1, keepdims=True)
    ahead = np.array([1.0, 0.0, 0.0]) - begin[:, :1] * begin
    aside = np.cross(begin, ahead)
    tilted = [_integrated(axis, rates, period) for axis in (ahead, aside)]
    return _integrated(begin, rates, period), np.stack(tilted, axis=-1)


def _integrated(begin: Floats, rates: Floats, period: float) -> Floats:
    """d/dt down = down × ω, in body axes."""
    found = np.empty_like(rates)
    down = begin
    middle = (rates[:, 1:] + rates[:, :-1]) / 2
    found[:, 0] = down
    for k in range(middle.shape[1]):
        turn = np.cross(down, period * middle[:, k])
        down = down + turn + np.cross(turn, period * middle[:, k]) / 2
        found[:, k + 1] = down
    return found


MOST_WINDOWS = 40  # those with most thrust; more hardly make it better


class FitInput(NamedTuple):
    """The data of a fit, and how they are taken."""

    windows: Windows
    thrust: CommandedThrust | None  # None: as measured, in `wrench`
    wrench: Floats  # (windows, n, 4) [N, N m] by the vehicle file's lag, or measured
    mean: Floats  # (windows, n / 2, 4) [N, N m] over each step of the model
    wander: float  # [rad/√s] of the tilt, by the gyroscopes' noise
    wake_share: float
    fits_lag: bool


def fit_input(data: DiveData, found: Windows, vehicle: Vehicle, wake_share: float) -> FitInput:
    """Thrust as measured, if it is; else from the commands."""
    if len(data.thrust):
        force = data.thrust @ effect_matrix(vehicle).T[:, list(ROWS)]
        pairs = (force[1:] + force[:-1]) / 2 * np.diff(data.thrust_t)[:, None]
        integral = np.vstack([np.zeros((1, 4)), np.cumsum(pairs, axis=0)])
        steps = _step_ends(found)
        wrench = columns_at(found.t, data.thrust_t, force)
        means = np.diff(columns_at(steps, data.thrust_t, integral), axis=1) / (2 * found.period)
        return FitInput(found, None, wrench, means, data.wander, wake_share, fits_lag=False)
    thrust = CommandedThrust(vehicle, data.command_t, data.commands)
    fits_lag = all(thruster.lag is None for thruster in vehicle.thruster)
    wrench, means = wrench_over(thrust, found, None)
    return FitInput(found, thrust, wrench, means, data.wander, wake_share, fits_lag)


def busiest(taken: FitInput) -> FitInput:
    """Only the windows in which the wrench changes most."""
    spread = taken.wrench.std(axis=1)
    scale = np.maximum(spread.max(axis=0, initial=0.0), 1e-9)
    order = np.argsort(-(spread / scale).max(axis=1, initial=0.0), kind="stable")[:MOST_WINDOWS]
    keep = np.sort(order)
    return only(taken, [int(n) for n in keep])


def only(taken: FitInput, keep: list[int]) -> FitInput:
    """These windows."""
    w = taken.windows
    windows = w._replace(
        t=w.t[keep], rates=w.rates[keep], force=w.force[keep], down=w.down[keep],
        tilted=w.tilted[keep],
        begin=w.begin[keep], depth_t=[w.depth_t[n] for n in keep],
        depth=[w.depth[n] for n in keep],
    )  # fmt: skip
    return taken._replace(windows=windows, wrench=taken.wrench[keep], mean=taken.mean[keep])


def wrench_over(
    thrust: CommandedThrust, windows: Windows, lag: float | None
) -> tuple[Floats, Floats]:
    """(windows, n, 4) [N, N m], and (windows, n / 2, 4) its mean over each step."""
    t, ends = windows.t, _step_ends(windows)
    value = thrust.wrench(t.ravel(), lag).value.reshape(*t.shape, 6)
    integral = thrust.wrench(ends.ravel(), lag).integral.reshape(*ends.shape, 6)
    means = np.diff(integral, axis=1) / (2 * windows.period)
    return value[..., list(ROWS)], means[..., list(ROWS)]


def _step_ends(windows: Windows) -> Floats:
    """(windows, n / 2 + 1) [s]"""
    return np.column_stack([windows.t[:, ::2], windows.t[:, -1] + windows.period])
