"""The curves of the link: delays, clocks, the latency budget and the prediction."""

from collections.abc import Callable
from math import degrees
from typing import Any

from messages import topics
from messages.link import DOWN_STAGES, UP_STAGES, Clock, ClockPong, LatencyBudget, LinkStatus, Stage
from messages.prediction import Miss, Prediction
from messages.video import PICTURE_STAGES, PictureAge
from services.visualizer.curve import (
    AXES,
    BOUND,
    DOWN,
    ESTIMATE,
    PREDICTED,
    REFERENCE,
    STICK,
    TRUTH,
    UP,
    Curve,
    CurveRow,
    number,
    way_ms,
)


def link_curves() -> list[Curve]:
    status = topics.LINK
    return [
        *_way("down", "down_link", DOWN),
        *_way("up", "up_link", UP),
        Curve("link_p99/rtt", status, ("rtt p50",), (TRUTH,), lambda m: number(m.rtt_ms)),
        *_clocks(),
        *_budget(),
        *_prediction(),
        *_picture(),
    ]


def _picture() -> list[Curve]:
    """The age of the drone's picture."""
    age, further, names = topics.PICTURE_AGE, topics.FURTHER_AGE, PICTURE_STAGES

    def stages(m: PictureAge) -> CurveRow | None:
        known = {stage.name: stage.p50_ms for stage in m.stages or ()}
        return [known[name] for name in names] if known.keys() >= set(names) else None

    def total(m: PictureAge) -> CurveRow | None:
        return None if m.total is None else (m.total.p50_ms, m.total.p99_ms)

    return [
        Curve("picture/stages", age, names, AXES[:3], stages),
        Curve("picture/total", age, ("light to picture p50", "p99"), (UP, TRUTH), total, 2.0),
        Curve("picture/now", age, ("age now",), (STICK,), lambda m: number(m.age_ms)),
        Curve("picture_rate/pictures", age, ("pictures",), (UP,), lambda m: (m.per_second,)),
        Curve("picture_rate/carried", age, ("carried",), (DOWN,), lambda m: (m.heard_kbit,)),
        Curve("picture/further", further, (), (), lambda m: number(m.age_ms)),
        Curve("picture_rate/pictures/further", further, (), (), lambda m: (m.per_second,)),
        Curve("picture_rate/all", topics.CAMERA_SHARES, (), (), lambda m: (m.total_kbit,)),
        Curve("picture_rate/carried/further", further, (), (), lambda m: (m.heard_kbit,)),
    ]


def _way(name: str, side: str, rgb: int) -> list[Curve]:
    topic = topics.LINK

    def median(m: LinkStatus) -> CurveRow | None:
        return number(getattr(m, side).delay_p50_ms)

    def slowest(m: LinkStatus) -> CurveRow | None:
        return number(getattr(m, side).delay_p99_ms)

    def queue(m: LinkStatus) -> CurveRow | None:
        return (float(getattr(m, side).queued),)

    def loss(m: LinkStatus) -> CurveRow | None:
        share = getattr(m, side).loss
        return None if share is None else (100.0 * share,)

    def rate(m: LinkStatus) -> CurveRow | None:
        return (getattr(m, side).rate_kbit,)

    return [
        Curve(f"latency/link_{name}", topic, (f"link {name}",), (rgb,), median),
        Curve(f"link_p99/{name}", topic, (f"{name} p99",), (rgb,), slowest),
        Curve(f"link_queue/{name}", topic, (name,), (rgb,), queue),
        Curve(f"link_loss/{name}", topic, (name,), (rgb,), loss),
        Curve(f"link_rate/{name}", topic, (name,), (rgb,), rate),
    ]


def _clocks() -> list[Curve]:
    clock, pong = topics.CLOCK, topics.CLOCK_PONG
    return [
        Curve("clock/offset", clock, ("drone - topside",), (ESTIMATE,), _offset),
        Curve("clock/bound", clock, ("at least", "at most"), (TRUTH, BOUND), _bounds),
        Curve("link_p99/ping", clock, ("rtt, ping",), (STICK,), lambda m: number(m.rtt_ms)),
        Curve("clock/turnaround", pong, ("ping → pong on board",), (AXES[3],), _turnaround),
        Curve("pings", topics.CLOCK_PING, ("sent",), (AXES[4],), _ping),
    ]


def _budget() -> list[Curve]:
    topic = topics.LATENCY
    down = (*AXES, STICK)[: len(DOWN_STAGES)]
    whole = ("stick → thruster", "sensor → screen")
    return [
        Curve("budget/down", topic, DOWN_STAGES, down, lambda m: _medians(m.down, DOWN_STAGES)),
        Curve("budget_up/up", topic, UP_STAGES, AXES[:3], lambda m: _medians(m.up, UP_STAGES)),
        Curve("whole/stick", topic, whole[:1], (REFERENCE,), _stick),
        Curve("shown", topics.SHOWN, (), (), lambda m: way_ms(m.sensor_ns, m.stamp_ns)),
        Curve("whole/screen", topic, whole[1:], (ESTIMATE,), _screen),
    ]


def _prediction() -> list[Curve]:
    topic, both = topics.PREDICTION, ("predicted", "delayed")
    return [
        Curve("depth/predicted", topic, ("predicted now",), (PREDICTED,), lambda m: (m.depth,)),
        Curve("heading/predicted", topic, ("predicted now",), (PREDICTED,), _heading),
        Curve("foresight/depth", topic, both, (PREDICTED, ESTIMATE), _depth_miss),
        Curve("foresight_heading/heading", topic, both, (PREDICTED, ESTIMATE), _turn_miss),
    ]


def _medians(stages: tuple[Stage, ...] | None, names: tuple[str, ...]) -> CurveRow | None:
    if stages is None or tuple(stage.name for stage in stages) != names:
        return None
    return [stage.p50_ms for stage in stages]


def _offset(m: Clock) -> CurveRow | None:
    return None if m.offset_ns is None else (m.offset_ns / 1e6,)


def _bounds(m: Clock) -> CurveRow | None:
    if m.offset_ns is None or m.bound_ns is None:
        return None
    return ((m.offset_ns - m.bound_ns) / 1e6, (m.offset_ns + m.bound_ns) / 1e6)


def _turnaround(m: ClockPong) -> CurveRow | None:
    return way_ms(m.heard_ns, m.stamp_ns)


def _ping(m: Any) -> CurveRow:
    return (float(m.seq),)


def _stick(m: LatencyBudget) -> CurveRow | None:
    return number(m.stick_to_thruster_ms)


def _screen(m: LatencyBudget) -> CurveRow | None:
    return number(m.sensor_to_screen_ms)


def _heading(m: Prediction) -> CurveRow:
    return (degrees(m.heading),)


def _depth_miss(m: Prediction) -> CurveRow | None:
    return _misses(m, lambda miss: 100.0 * miss.depth)


def _turn_miss(m: Prediction) -> CurveRow | None:
    return _misses(m, lambda miss: degrees(miss.heading))


def _misses(m: Prediction, read: Callable[[Miss], float]) -> CurveRow | None:
    """Errors of the prediction and of the delayed state; None until both are known."""
    if m.missed is None or m.delayed is None:
        return None
    return (read(m.missed), read(m.delayed))
