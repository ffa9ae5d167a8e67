"""Simulator service: thruster commands in; sensors, actuation and ground truth out."""

from collections import deque
from collections.abc import Callable

from messages import topics
from messages.control import ThrusterCommand
from messages.pilot import PilotRequest
from messages.simulator import FaultAnswer, FaultRequest
from messages.topic import M, Topic
from services.marine.vehicle import Vehicle
from services.runtime.config.errors import LindyError
from services.runtime.config.settings import nearest
from services.runtime.config.stack import Stack
from services.runtime.node.node import Node
from services.runtime.node.ports import Publisher
from services.simulator import fault_requests
from services.simulator.core import Settings, Simulator, WorldCheckpoint, at_the_surface

CHECKPOINT_HZ = 5.0  # [1/s] a restarted simulator loses at most one period


def wire(node: Node, stack: Stack) -> None:
    simulator = _simulator(node, stack)
    imu = node.publisher(topics.IMU)
    magnetometer = node.publisher(topics.MAGNETOMETER)
    pressure = node.publisher(topics.PRESSURE)
    battery = node.publisher(topics.BATTERY)
    actuation = node.publisher(topics.ACTUATION)
    truth = node.publisher(topics.TRUTH)
    field_is_due = _once_in_a_period(stack.section("simulator", Settings).magnetometer_rate)

    def count(names: list[str]) -> None:
        for name in names:
            node.count(name)

    def obey(command: ThrusterCommand, now: int) -> None:
        count(simulator.obey(command, now))

    def measure_motion(now: int) -> None:
        count(simulator.advance(now))
        if field_is_due(now):
            publish(node, magnetometer, simulator.magnetometer())
        publish(node, imu, simulator.imu())  # last, because it triggers estimation
        actuation.put(simulator.actuation())
        truth.put(simulator.truth())

    def measure_pressure(now: int) -> None:
        count(simulator.advance(now))
        publish(node, pressure, simulator.pressure())

    def measure_battery(now: int) -> None:
        count(simulator.advance(now))
        publish(node, battery, simulator.battery())
        if simulator.battery_empty:
            node.count("empty:battery")

    node.each(topics.THRUSTERS, obey)
    _disarms(node, simulator, count)
    node.every(stack.section("simulator", Settings).pressure_rate, measure_pressure)
    node.every(stack.section("simulator", Settings).imu_rate, measure_motion)
    node.every(topics.BATTERY.hz, measure_battery)
    _enclosure(node, simulator, count)
    _faults(node, simulator, count)
    _position_aids(node, simulator, stack.section("simulator", Settings), count)
    node.every(CHECKPOINT_HZ, lambda _: node.save_checkpoint(simulator.world()))


def _once_in_a_period(hz: float) -> Callable[[int], bool]:
    """For what is measured with the motion, but not as often: is it due?"""
    period_ns, next_ns = round(1e9 / hz), 0

    def is_due(now: int) -> bool:
        nonlocal next_ns
        if now < next_ns:
            return False
        next_ns = max(next_ns + period_ns, now + period_ns // 2)  # not all that was missed at once
        return True

    return is_due


def publish(node: Node, publisher: Publisher[M], sample: M | None) -> None:
    """A sample; None: a fault keeps the sensor silent."""
    if sample is None:
        node.count(f"silent_by_fault:{publisher.topic.key}")
    else:
        publisher.put(sample)


def _enclosure(node: Node, simulator: Simulator, count: Callable[[list[str]], None]) -> None:
    """Leak detector and thermometer."""
    leak, temperature = node.publisher(topics.LEAK), node.publisher(topics.TEMPERATURE)

    def measure(now: int) -> None:
        count(simulator.advance(now))
        publish(node, leak, simulator.leak())
        publish(node, temperature, simulator.temperature())

    node.every(topics.LEAK.hz, measure)


def _disarms(node: Node, simulator: Simulator, count: Callable[[list[str]], None]) -> None:
    """Obey the pilot's disarm, as every vehicle side does."""

    def hear(request: PilotRequest, now: int) -> None:
        if request.kind == "disarm":
            count(simulator.hear(request, now))

    node.each(topics.PILOT_REQUEST, hear)


def _faults(node: Node, simulator: Simulator, count: Callable[[list[str]], None]) -> None:
    """Set and clear faults by request."""

    def decide(request: FaultRequest, now: int) -> FaultAnswer:
        answer, counts = fault_requests.decide(simulator, request, now, nearest)
        count(counts)
        return answer

    def report(request: FaultRequest, answer: FaultAnswer, _: int) -> None:
        if answer.accepted:
            node.log(*fault_requests.in_words(request))
            node.save_checkpoint(simulator.world())

    node.answers(topics.FAULT_REQUEST, topics.FAULT_ANSWER, decide, report)


def _position_aids(
    node: Node, simulator: Simulator, settings: Settings, count: Callable[[list[str]], None]
) -> None:
    """DVL and USBL, if the vehicle has them."""
    if (dvl := settings.dvl) is not None:
        publish_velocity = _late_publisher(node, topics.DVL, dvl.latency)

        def measure_velocity(now: int) -> None:
            count(simulator.advance(now))
            sample = simulator.dvl(dvl)
            if sample is None:
                silent = "sensor/dvl" in simulator.silent
                node.count("silent_by_fault:sensor/dvl" if silent else "no_bottom:sensor/dvl")
            else:
                publish_velocity(sample, now)

        node.every(dvl.rate, measure_velocity)
    if (usbl := settings.usbl) is not None:
        publish_position = _late_publisher(node, topics.USBL, usbl.latency)

        def measure_position(now: int) -> None:
            count(simulator.advance(now))
            sample = simulator.usbl(usbl)
            if sample is None:
                node.count("silent_by_fault:sensor/usbl")
            else:
                publish_position(sample, now)

        node.every(usbl.rate, measure_position)


def _late_publisher(node: Node, topic: Topic[M], latency: float) -> Callable[[M, int], None]:
    """Publishes a message with a delay of `latency` [s]."""
    publisher = node.publisher(topic)
    waiting: deque[tuple[int, M]] = deque()

    def publish_due(now: int) -> None:
        while waiting and waiting[0][0] <= now:
            publisher.put(waiting.popleft()[1])
        if waiting:
            alarm.set(waiting[0][0])

    alarm = node.alarm(publish_due)

    def enqueue(message: M, now: int) -> None:
        waiting.append((now + round(latency * 1e9), message))
        publish_due(now)

    return enqueue


def _simulator(node: Node, stack: Stack) -> Simulator:
    """From the checkpoint, if there is one; else at the surface."""
    vehicle = stack.section("vehicle", Vehicle)
    settings = stack.section("simulator", Settings)
    world = node.restore_checkpoint(WorldCheckpoint)
    if world is not None and not world.fits(vehicle):
        node.count("malformed:memory")
        world = None
    try:
        return Simulator(vehicle, settings, stack.seed, world or at_the_surface(vehicle, settings))
    except ValueError as error:
        raise LindyError(f"{stack.vehicle_path}: {error}") from None
