"""Estimation service: one state per IMU sample; the other sensors correct it.

Of several queued IMU samples all are used, but only the newest becomes a state.

It subscribes to the reference only if the vehicle file says `[estimation.depth] observer =
"reference"`.
"""

from collections.abc import Callable
from typing import TypeVar

from messages import topics
from messages.reference import Reference
from messages.sensors import ImuSample
from messages.state import VehicleState
from services.estimation.core import EstimationCheckpoint, Estimator, Settings
from services.marine.vehicle import Vehicle
from services.runtime.config.stack import Stack
from services.runtime.node.node import Node

SILENCE_S = 0.05  # [s] five IMU periods
CHECKPOINT_HZ = 1.0  # [1/s]
Sample = TypeVar("Sample")


def wire(node: Node, stack: Stack) -> None:
    settings = stack.section("estimation", Settings)
    vehicle = stack.section("vehicle", Vehicle)
    before = node.restore_checkpoint(EstimationCheckpoint)
    estimator = Estimator(settings, vehicle.floating_depth, before, vehicle, node.counts)
    publisher = node.publisher(topics.STATE)
    reference = reference_for(node, settings)

    def on_imu(sample: ImuSample | None, now: int) -> None:
        estimator.reference(reference(now))
        state = estimator.silence(now) if sample is None else estimator.imu(sample, now)
        publish(state)

    def on_earlier(sample: ImuSample, now: int) -> None:
        estimator.reference(reference(now))
        estimator.follow(sample)

    def publish(state: VehicleState | None) -> None:
        if state is not None:
            publisher.put(state)
        report(node, estimator)

    def save(now: int) -> None:
        if (checkpoint := estimator.checkpoint(now)) is not None:
            node.save_checkpoint(checkpoint)

    node.each(topics.PRESSURE, timeless(estimator.pressure))
    node.each(topics.MAGNETOMETER, timeless(estimator.magnetometer))
    node.each(topics.DVL, timeless(estimator.dvl))
    node.each(topics.USBL, timeless(estimator.usbl))
    node.each(topics.ACTUATION, timeless(estimator.actuation))
    node.trigger(topics.IMU, on_imu, SILENCE_S, earlier=on_earlier)
    node.every(CHECKPOINT_HZ, save)
    report(node, estimator)


def timeless(use: Callable[[Sample], None]) -> Callable[[Sample, int], None]:
    """A handler that ignores the time."""
    return lambda sample, _: use(sample)


def reference_for(node: Node, settings: Settings) -> Callable[[int], Reference | None]:
    """The fresh reference, for the depth observer "reference" only."""
    if settings.depth.observer != "reference":
        return lambda _: None
    return node.latest(topics.REFERENCE).fresh


def report(node: Node, estimator: Estimator) -> None:
    """Count and log events."""
    for name in estimator.events:
        node.count(name)
    for level, text in estimator.lines:
        node.log(level, text)
    estimator.events.clear()
    estimator.lines.clear()
