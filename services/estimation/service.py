"""Estimation service: each IMU sample becomes one state; pressure and compass correct it.

Of samples that have piled up every one is used and the newest becomes a state: control has no use
for the others.

It hears the reference only if the vehicle file says `[estimation.depth] observer = "reference"`.
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
REMEMBER_HZ = 1.0  # [1/s]
Sample = TypeVar("Sample")


def wire(node: Node, stack: Stack) -> None:
    settings = stack.section("estimation", Settings)
    vehicle = stack.section("vehicle", Vehicle)
    estimator = Estimator(
        settings, vehicle.floating_depth, node.restore_checkpoint(EstimationCheckpoint), vehicle
    )
    publisher = node.publisher(topics.STATE)
    reference = reference_for(node, settings)

    def on_imu(sample: ImuSample | None, now: int) -> None:
        estimator.reference(reference(now))
        state = estimator.silence(now) if sample is None else estimator.imu(sample, now)
        say(state)

    def on_earlier(sample: ImuSample, now: int) -> None:
        estimator.reference(reference(now))
        estimator.follow(sample)

    def say(state: VehicleState | None) -> None:
        if state is not None:
            publisher.put(state)
        tell(node, estimator)

    def keep(now: int) -> None:
        if (worth_keeping := estimator.checkpoint(now)) is not None:
            node.save_checkpoint(worth_keeping)

    node.each(topics.PRESSURE, timeless(estimator.pressure))
    node.each(topics.MAGNETOMETER, timeless(estimator.magnetometer))
    node.each(topics.DVL, timeless(estimator.dvl))
    node.each(topics.USBL, timeless(estimator.usbl))
    node.each(topics.ACTUATION, timeless(estimator.actuation))
    node.trigger(topics.IMU, on_imu, SILENCE_S, earlier=on_earlier)
    node.every(REMEMBER_HZ, keep)
    tell(node, estimator)


def timeless(use: Callable[[Sample], None]) -> Callable[[Sample, int], None]:
    """A handler of samples that does not ask what time it is."""
    return lambda sample, _: use(sample)


def reference_for(node: Node, settings: Settings) -> Callable[[int], Reference | None]:
    """The fresh reference, for the one depth observer that wants it."""
    if settings.depth.observer != "reference":
        return lambda _: None
    return node.latest(topics.REFERENCE).fresh


def tell(node: Node, estimator: Estimator) -> None:
    """Pass on what happened: names to the counters, words to people."""
    for name in estimator.events:
        node.count(name)
    for level, text in estimator.lines:
        node.log(level, text)
    estimator.events.clear()
    estimator.lines.clear()
