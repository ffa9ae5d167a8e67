"""Simulator service: thruster commands in; sensors, actuation and ground truth out."""

from collections import deque
from collections.abc import Callable

from messages import events, topics
from messages.events import Outbox
from messages.pilot import PilotRequest
from messages.simulator import FaultAnswer, FaultRequest
from messages.topic import M, Topic
from services.marine.vehicle import Vehicle
from services.runtime.config.errors import LindyError
from services.runtime.config.settings import nearest
from services.runtime.config.stack import Stack
from services.runtime.node.node import Node
from services.runtime.node.ports import Publisher
from services.simulator import faults
from services.simulator.core import Settings, Simulator, WorldCheckpoint, at_the_surface
from services.simulator.settings import Dvl, Usbl

CHECKPOINT_HZ = 5.0  # [1/s] a restarted simulator loses at most one period


def wire(node: Node, stack: Stack) -> None:
    simulator = _simulator(node, stack)
    imu = node.publisher(topics.IMU)
    magnetometer = node.publisher(topics.MAGNETOMETER)
    pressure = node.publisher(topics.PRESSURE)
    battery = node.publisher(topics.BATTERY)
    actuation = node.publisher(topics.ACTUATION)
    truth = node.publisher(topics.TRUTH)
    status = node.latest(topics.STATUS)
    settings = stack.section("simulator", Settings)
    field_period_ns, field_due_ns = round(1e9 / settings.magnetometer_rate), 0

    def measure_motion(now: int) -> None:
        nonlocal field_due_ns
        simulator.advance(now)
        # With the motion, but not as often; not all that was missed at once.
        if now >= field_due_ns:
            field_due_ns = max(field_due_ns + field_period_ns, now + field_period_ns // 2)
            publish(node, magnetometer, simulator.magnetometer())
        simulator.look(status.newest(now))
        publish(node, imu, simulator.imu())  # last, because it triggers estimation
        actuation.put(simulator.actuation())
        truth.put(simulator.truth())

    def measure_pressure(now: int) -> None:
        simulator.advance(now)
        publish(node, pressure, simulator.pressure())

    def measure_battery(now: int) -> None:
        simulator.advance(now)
        publish(node, battery, simulator.battery())
        if simulator.battery_empty:
            node.tell(events.EMPTY("battery"))

    node.each(topics.THRUSTERS, simulator.obey)
    _disarms(node, simulator)
    node.every(settings.pressure_rate, measure_pressure)
    node.every(settings.imu_rate, measure_motion)
    node.every(topics.BATTERY.hz, measure_battery)
    _enclosure(node, simulator)
    _faults(node, simulator)
    _position_aids(node, simulator, settings)
    node.every(CHECKPOINT_HZ, lambda _: node.save_checkpoint(simulator.world()))


def publish(node: Node, publisher: Publisher[M], sample: M | None) -> None:
    """A sample; None: a fault keeps the sensor silent."""
    if sample is None:
        node.tell(events.SILENT_BY_FAULT(publisher.topic.key))
    else:
        publisher.put(sample)


def _enclosure(node: Node, simulator: Simulator) -> None:
    """Leak detector and thermometer."""
    leak, temperature = node.publisher(topics.LEAK), node.publisher(topics.TEMPERATURE)

    def measure(now: int) -> None:
        simulator.advance(now)
        publish(node, leak, simulator.leak())
        publish(node, temperature, simulator.temperature())

    node.every(topics.LEAK.hz, measure)


def _disarms(node: Node, simulator: Simulator) -> None:
    """Obey the pilot's disarm, as every vehicle side does."""

    def hear(request: PilotRequest, now: int) -> None:
        if request.kind == "disarm":
            simulator.hear(request, now)

    node.each(topics.PILOT_REQUEST, hear)


def _faults(node: Node, simulator: Simulator) -> None:
    """Set and clear faults by request."""

    def report(request: FaultRequest, answer: FaultAnswer, _: int) -> None:
        if answer.accepted:
            node.log(*faults.in_words(request))
            node.save_checkpoint(simulator.world())

    node.answers(
        topics.FAULT_REQUEST,
        topics.FAULT_ANSWER,
        lambda request, now: decide(simulator, request, now, node.outbox),
        report,
    )


def decide(simulator: Simulator, request: FaultRequest, now: int, outbox: Outbox) -> FaultAnswer:
    """Set or clear a fault, or refuse."""
    request = faults.by_key(request, simulator.sensors)
    reason = faults.refusal(request, simulator.thrusters, simulator.sensors, nearest)
    if reason:
        outbox.tell(events.REFUSED_FAULT())
    else:
        simulator.break_or_mend(request, now)
    return FaultAnswer(
        stamp_ns=now,
        id=request.id,
        accepted=not reason,
        reason=reason,
        cause_ns=request.stamp_ns,
    )


def _position_aids(node: Node, simulator: Simulator, settings: Settings) -> None:
    """DVL and USBL, if the vehicle has them."""
    dvl, usbl = settings.dvl, settings.usbl
    if dvl is not None:
        _late(node, simulator, topics.DVL, dvl, lambda: simulator.dvl(dvl))
    if usbl is not None:
        _late(node, simulator, topics.USBL, usbl, lambda: simulator.usbl(usbl))


def _late(
    node: Node,
    simulator: Simulator,
    topic: Topic[M],
    device: Dvl | Usbl,
    measure: Callable[[], M | None],
) -> None:
    """Publishes what is measured at the device's rate with its latency."""
    publisher = node.publisher(topic)
    waiting: deque[tuple[int, M]] = deque()

    def publish_due(now: int) -> None:
        while waiting and waiting[0][0] <= now:
            publisher.put(waiting.popleft()[1])
        if waiting:
            alarm.set(waiting[0][0])

    alarm = node.alarm(publish_due)

    def measured(now: int) -> None:
        simulator.advance(now)
        sample = measure()
        if sample is None:
            node.tell(events.SILENT_BY_FAULT(topic.key))
        else:
            waiting.append((now + round(device.latency * 1e9), sample))
            publish_due(now)

    node.every(device.rate, measured)


def _simulator(node: Node, stack: Stack) -> Simulator:
    """From the checkpoint, if there is one; else at the surface."""
    vehicle = stack.section("vehicle", Vehicle)
    settings = stack.section("simulator", Settings)
    world = node.restore_checkpoint(WorldCheckpoint)
    if world is not None and not world.fits(vehicle):
        node.tell(events.MALFORMED_CHECKPOINT())
        world = None
    try:
        world = world or at_the_surface(vehicle, settings)
        return Simulator(vehicle, settings, stack.seed, world, node.outbox)
    except ValueError as error:
        raise LindyError(f"{stack.vehicle_path}: {error}") from None
