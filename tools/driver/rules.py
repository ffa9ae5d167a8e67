"""What every vehicle side promises, simulated or not (docs/your-own-vehicle.md): one function a
promise, which its docstring says in one sentence.
"""

import math
from collections.abc import Callable
from itertools import cycle, pairwise
from statistics import fmean
from typing import Any

from messages import topics
from services.estimation.sensor import RATE_TOLERANCE
from services.marine.attitude import wrapped
from services.vehicle.mounting import MountedAxes
from tools.driver.bench import ALWAYS, SAID, Bench, BrokenRuleError, S

MS = 1_000_000  # [ns]
HEAVE, YAW = 2, 5
START_S = 1.0  # [s] in which thrusters follow a command: a board may have to arm them first
JITTER_NS = 2 * MS  # [ns] between readings of the clock in two processes
OVERSHOOT = 1.2  # [-] times its limits that a thruster may report


def require(kept: bool, words: str) -> None:
    if not kept:
        raise BrokenRuleError(words)


# What it says.


def rates(bench: Bench) -> None:
    """Sensors come at their rates."""
    began = bench.now()
    bench.run(5.0)
    watch = bench.estimation.watch
    nominal = {t.key: t.hz for t in (topics.IMU, topics.ACTUATION)}
    nominal[topics.PRESSURE.key] = watch.pressure_rate
    nominal[topics.MAGNETOMETER.key] = watch.magnetometer_rate
    for topic in ALWAYS:
        require(bool(bench.all(topic, began)), f"nothing came on {topic.key} in 5 s")
    for key, hz in nominal.items():
        stamps = [m.stamp_ns for _, m in bench.heard[key] if m.stamp_ns >= began]
        if len(stamps) > 1:
            rate = (len(stamps) - 1) / (stamps[-1] - stamps[0]) * S
            near = abs(rate - hz) <= RATE_TOLERANCE * hz
            require(near, f"{key} comes at {rate:.1f} Hz, expected {hz:g}")


def stamps(bench: Bench) -> None:
    """Every stream is stamped in order, by the clock that its handlers are given."""
    bench.run(5.0)
    for topic in SAID:
        messages, key = bench.heard[topic.key], topic.key
        for (_, before), (_, after) in pairwise(messages):
            require(after.stamp_ns > before.stamp_ns, f"{key}: a stamp is not later than the last")
            require(after.seq > before.seq, f"{key}: a number is not greater than the last")
        for arrival, message in messages:
            ahead = (message.stamp_ns - arrival) / S
            require(ahead * S <= JITTER_NS, f"{key}: a stamp is {ahead:.3f} s in the future")
            if topic in ALWAYS and topic.stale_after_ns is not None:
                fresh = -ahead * S <= topic.stale_after_ns
                require(fresh, f"{key}: a stamp is {-ahead:.3f} s old when the message arrives")


def rest(bench: Bench) -> None:
    """At rest the sensors say what rest is, in the units of the topics."""
    began = bench.now()
    bench.run(3.0)
    axes, imu = MountedAxes(bench.vehicle.mounting.imu), bench.all(topics.IMU, began)
    forces = [axes.to_body(m.specific_force) for m in imu]
    force = [fmean(part) for part in zip(*forces, strict=True)]
    size = math.hypot(*force)
    require(abs(size - 9.81) <= 0.5, f"the specific force is {size:.2f}, expected 9.8 m/s²")
    require(force[2] < -8.5, f"the specific force along z is {force[2]:.1f}, expected -9.8: up")
    turn = math.hypot(*(fmean(part) for part in zip(*[m.angular_rate for m in imu], strict=True)))
    require(turn < 0.1, f"the angular rate is {turn:.2f}, expected less than 0.1 rad/s")
    pressure = fmean(m.pressure for m in bench.all(topics.PRESSURE, began))
    absolute = 70e3 < pressure < 120e3
    require(absolute, f"the pressure is {pressure:.4g}, expected 70e3 to 120e3 Pa, absolute")
    for sample in bench.all(topics.MAGNETOMETER, began):
        field = math.hypot(*sample.field)
        near = 15e-6 < field < 100e-6
        require(near, f"the magnetic field is {field:.3g}, expected 15e-6 to 100e-6 T")
    for battery in bench.all(topics.BATTERY):
        known = 3.0 < battery.voltage < 1000.0
        require(known, f"the battery's voltage is {battery.voltage:g}, expected 3 to 1000 V")


def actuation(bench: Bench) -> None:
    """Each actuation is whole, within the limits, and says which command it is of."""
    first = bench.produced()[0]
    require(first.stale and not any(first.thrust), "it acts before anything was commanded")
    bench.ask(bench.along(HEAVE, 0.2))
    bench.run(START_S)
    asked = bench.now()
    bench.run(0.5)
    for report in bench.produced(asked):
        _within_limits(bench, report.thrust)
        require(not report.stale, "it says `stale` while commands arrive")
        acted, of = report.actuated_ns, report.sensor_ns
        require(acted is not None and acted <= report.stamp_ns, "`actuated_ns` is after `stamp_ns`")
        require(of is not None, "`sensor_ns` of the command is missing")
        assert of is not None
        require(report.pilot_ns == of - 1, "`pilot_ns` is not that of the same command")
        require(report.stamp_ns - of <= 200 * MS, "it is of a command over 200 ms old")
    require(bench.acts(), "no thruster pushes although thrust is commanded")


# What it does.


def heave_sign(bench: Bench) -> None:
    """Thrust along +z is down, and makes the pressure rise."""
    began = bench.now()
    bench.run(1.0)
    before = fmean(m.pressure for m in bench.all(topics.PRESSURE, began))
    bench.ask(bench.along(HEAVE))
    bench.run(4.0)
    after = fmean(m.pressure for m in bench.all(topics.PRESSURE, bench.now() - S // 2))
    rises = after > before + 1000.0
    require(rises, f"the pressure changes by {after - before:+.0f} Pa, expected at least +1000")


def yaw_sign(bench: Bench) -> None:
    """A moment about +z turns clockwise, and gyroscope and compass agree."""
    down, turn = bench.along(HEAVE, 0.4), bench.along(YAW, 0.3)
    bench.ask(down)
    bench.run(3.0)  # all thrusters under water
    bench.ask(tuple(a + b for a, b in zip(down, turn, strict=True)))
    began = bench.now()
    bench.run(2.0)
    axes = MountedAxes(bench.vehicle.mounting.imu)
    imu = bench.all(topics.IMU, began)
    yaw = [(m.stamp_ns, axes.to_body(m.angular_rate)[2]) for m in imu]
    rate = fmean(r for _, r in yaw[len(yaw) // 2 :])
    require(rate > 0.05, f"the gyroscope reads {rate:+.3f} rad/s, expected more than +0.05")
    field = MountedAxes(bench.vehicle.mounting.magnetometer)
    seen = [field.to_body(m.field) for m in bench.all(topics.MAGNETOMETER, began)]
    if seen:
        turned = sum((b - a) / S * r for (a, r), (b, _) in pairwise(yaw))
        headings = [math.atan2(-y, x) for x, y, _ in seen]
        compass = sum(wrapped(b - a) for a, b in pairwise(headings))
        agree = abs(compass - turned) <= max(0.2, 0.3 * abs(turned))
        require(agree, f"the gyroscope turned by {turned:.2f} rad, the compass by {compass:.2f}")


def limits(bench: Bench) -> None:
    """Thrust is held to the limits of the vehicle file, and counted."""
    count = len(bench.vehicle.thruster)
    bench.ask(tuple(1e6 if i % 2 else -1e6 for i in range(count)))
    bench.run(2.2)
    for report in bench.produced():
        _within_limits(bench, report.thrust)
    counted = any(name.startswith("saturated:") for name in bench.counts)
    require(counted, "no `saturated:` is counted in its health")


# What it refuses.


def silence(bench: Bench) -> None:
    """Silence stops the thrusters when the command's time is over, and commands act again."""
    bench.ask(bench.along(HEAVE, 0.3))
    bench.run(START_S)
    require(bench.acts(), "no thruster pushes although thrust is commanded")
    bench.be_silent()
    ended = bench.now() + 200 * MS
    bench.run(0.2 + bench.decay_s() + 0.5)
    stale = all(report.stale for report in bench.produced(ended + JITTER_NS + 10 * MS))
    require(stale, "it does not say `stale` 0.2 s after the last command")
    still = bench.at_rest_again(ended + round(bench.decay_s() * S))
    require(still, "thrusters push on 0.2 s after the last command")
    require(bool(bench.all(topics.IMU, ended)), "it measures nothing while nobody commands")
    bench.ask(bench.along(HEAVE, 0.3))
    bench.run(START_S)
    acts = bench.acts() and not bench.produced()[-1].stale
    require(acts, "commands do not act again after a silence")


def disarm(bench: Bench) -> None:
    """The pilot's disarm alone stops the thrusters, while a control that hangs goes on."""
    armed_ns = bench.now()
    bench.ask(bench.along(HEAVE, 0.3), armed_ns=armed_ns)
    bench.run(START_S)
    bench.disarm(epoch=0)
    bench.run(0.5)
    require(bench.acts(), "the disarm of another epoch stops it")
    disarmed = bench.now()
    bench.disarm(epoch=1)
    bench.run(bench.decay_s() + 0.5)
    stopped = bench.at_rest_again(disarmed + round(bench.decay_s() * S))
    require(stopped, "thrusters push on after a `pilot/request` to disarm")
    bench.ask((0.0,) * len(bench.vehicle.thruster), armed=False)
    bench.run(0.3)
    began = bench.now()
    bench.ask(bench.along(HEAVE, 0.3), armed_ns=armed_ns)  # woken again, with what it knew before
    bench.run(0.5)
    require(bench.at_rest_again(began), "an arming from before the disarm arms again")
    bench.ask(bench.along(HEAVE, 0.3), armed_ns=bench.now())
    bench.run(START_S)
    require(bench.acts(), "a later arming does not act")


def refusals(bench: Bench) -> None:
    """Nothing wrong acts: of another length, not a number, old, early, disarmed, no message."""
    # Past a health report of one a second, each is seen to be counted.
    each_s = 1.2 if bench.virtual else 0.3
    count, now = len(bench.vehicle.thruster), bench.now
    some = list(bench.along(HEAVE, 0.3))
    whole = {"sensor_ns": None, "pilot_ns": None, "thrust": some, "ttl_ms": 200.0, "epoch": 3}
    # An older epoch is refused while the newer one is heard.
    older = cycle([{"epoch": 3, "thrust": [0.0] * count}, {"epoch": 2}])
    wrong: dict[str, Callable[[], dict[str, Any]]] = {
        "with a thruster too few": lambda: {"thrust": some[1:]},
        "with a thruster too many": lambda: {"thrust": [*some, 1.0]},
        "without thrusters": lambda: {"thrust": []},
        "of not-a-number": lambda: {"thrust": [math.nan] * count},
        "without end": lambda: {"thrust": [math.inf] * count},
        "of words": lambda: {"thrust": ["full"] * count},
        "of an older epoch": lambda: next(older),
        "a second old": lambda: {"stamp_ns": now() - S},
        "10 s in the future": lambda: {"stamp_ns": now() + 10 * S},
        "with a time-to-live of a minute": lambda: {"ttl_ms": 60_000.0},
        "that is disarmed": lambda: {"armed": False},
    }
    bench.ask((0.0,) * count, epoch=3)
    bench.run(0.3)
    for words, other in wrong.items():
        _refuses(
            bench,
            words,
            lambda other=other: {**whole, "stamp_ns": now(), "armed": True, **other()},
            each_s,
        )
    _refuses(bench, "that does not say `armed`", lambda: {**whole, "stamp_ns": now()}, each_s)
    _refuses(bench, "without any field", dict, each_s)
    bench.commanding = lambda _: bench.say(b"\xc1 no message")
    began = bench.now()
    bench.run(0.3)
    require(bench.at_rest_again(began), "bytes that are no message act")
    bench.ask(tuple(some), epoch=3)
    bench.run(START_S)
    require(bench.acts(), "what is right does not act after what was wrong")
    require(bench.refused > 0, "nothing of it is counted in its health")


def _refuses(bench: Bench, words: str, made: Callable[[], dict[str, Any]], each_s: float) -> None:
    counted, began = bench.refused, bench.now()
    bench.commanding = lambda _: bench.put(made())
    bench.run(each_s)
    require(bench.at_rest_again(began), f"a command {words} acts")
    require(each_s < 1.0 or bench.refused > counted, f"a command {words} is not counted")


def _within_limits(bench: Bench, thrust: tuple[float, ...]) -> None:
    thrusters = bench.vehicle.thruster
    same = len(thrust) == len(thrusters)
    require(same, f"it reports {len(thrust)} thrusters, the file has {len(thrusters)}")
    for thruster, newtons in zip(thrusters, thrust, strict=True):
        low, high = thruster.limits
        inside = OVERSHOOT * low <= newtons <= OVERSHOOT * high
        require(
            inside, f"{thruster.name} reports {newtons:.1f} N, its limits are {low:g}, {high:g}"
        )


Rule = Callable[[Bench], None]
MOVES: tuple[Rule, ...] = (heave_sign, yaw_sign)  # not on the bench
REFUSES: tuple[Rule, ...] = (silence, disarm, refusals)
RULES: tuple[Rule, ...] = (rates, stamps, rest, actuation, *MOVES, limits, *REFUSES)


def sentence(rule: Rule) -> str:
    return (rule.__doc__ or "").strip()
