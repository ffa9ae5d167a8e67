"""Estimation service: one state per IMU sample; the other sensors correct it.

Of several queued IMU samples all are used, but only the newest becomes a state.
"""

from collections.abc import Callable
from typing import TypeVar

from messages import topics
from messages.sensors import ImuSample
from services.estimation.checkpoint import EstimationCheckpoint
from services.estimation.core import AID_SOURCES, Estimator
from services.estimation.settings import Settings
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
    estimator = Estimator(settings, vehicle.floating_depth, before, vehicle, node.outbox)
    publisher = node.publisher(topics.STATE)
    sources = {name: node.publisher(topics.AIDING.of(name)) for name in AID_SOURCES}

    def on_imu(sample: ImuSample | None, now: int) -> None:
        state = estimator.silence(now) if sample is None else estimator.imu(sample, now)
        if state is not None:
            publisher.put(state)
        for name, source in estimator.aid_sources(now):
            sources[name].put(source)

    def on_earlier(sample: ImuSample, _: int) -> None:
        estimator.follow(sample)

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


def timeless(use: Callable[[Sample], None]) -> Callable[[Sample, int], None]:
    """A handler that ignores the time."""
    return lambda sample, _: use(sample)
