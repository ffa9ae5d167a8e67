"""Estimation service: each IMU sample becomes one state; pressure and compass correct it."""

from messages import topics
from messages.sensors import (
    DvlSample,
    ImuSample,
    MagnetometerSample,
    PressureSample,
    UsblSample,
)
from messages.state import VehicleState
from services.estimation.core import Estimator, Remembered, Settings
from services.marine.vehicle import Vehicle
from services.runtime.node import Node
from services.runtime.stack import Stack

SILENCE_S = 0.05  # [s] five IMU periods
REMEMBER_HZ = 1.0  # [1/s]


def wire(node: Node, stack: Stack) -> None:
    settings = stack.section("estimation", Settings)
    floating_depth = stack.section("vehicle", Vehicle).floating_depth
    estimator = Estimator(settings, floating_depth, node.recall(Remembered))
    publisher = node.publisher(topics.STATE)

    def on_imu(sample: ImuSample | None, now: int) -> None:
        state = estimator.silence(now) if sample is None else estimator.imu(sample, now)
        say(state)

    def on_pressure(sample: PressureSample, _: int) -> None:
        estimator.pressure(sample)

    def on_magnetometer(sample: MagnetometerSample, _: int) -> None:
        estimator.magnetometer(sample)

    def on_dvl(sample: DvlSample, _: int) -> None:
        estimator.dvl(sample)

    def on_usbl(sample: UsblSample, _: int) -> None:
        estimator.usbl(sample)

    def say(state: VehicleState | None) -> None:
        if state is not None:
            publisher.put(state)
        tell(node, estimator)

    def keep(now: int) -> None:
        if (worth_keeping := estimator.remembered(now)) is not None:
            node.remember(worth_keeping)

    node.each(topics.PRESSURE, on_pressure)
    node.each(topics.MAGNETOMETER, on_magnetometer)
    node.each(topics.DVL, on_dvl)
    node.each(topics.USBL, on_usbl)
    node.trigger(topics.IMU, on_imu, SILENCE_S)
    node.every(REMEMBER_HZ, keep)
    tell(node, estimator)


def tell(node: Node, estimator: Estimator) -> None:
    """Pass on what happened: names to the counters, words to people."""
    for name in estimator.noted:
        node.count(name)
    for level, text in estimator.lines:
        node.log(level, text)
    estimator.noted.clear()
    estimator.lines.clear()
