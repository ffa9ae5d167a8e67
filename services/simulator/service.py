"""The simulator on the bus: thruster commands in; sensors, actuation and the truth out."""

from messages import topics
from messages.control import ThrusterCommand
from services.marine.vehicle import Vehicle
from services.runtime.errors import LindyError
from services.runtime.node import Node
from services.runtime.stack import Stack
from services.simulator.core import Settings, Simulator, World, at_the_surface

REMEMBER_HZ = 5.0  # [1/s] a killed simulator resumes from at most this long ago


def wire(node: Node, stack: Stack) -> None:
    simulator = _simulator(node, stack)
    imu = node.publisher(topics.IMU)
    magnetometer = node.publisher(topics.MAGNETOMETER)
    pressure = node.publisher(topics.PRESSURE)
    battery = node.publisher(topics.BATTERY)
    actuation = node.publisher(topics.ACTUATION)
    truth = node.publisher(topics.TRUTH)

    def count(names: list[str]) -> None:
        for name in names:
            node.count(name)

    def obey(command: ThrusterCommand, now: int) -> None:
        count(simulator.obey(command, now))

    def measure_motion(now: int) -> None:
        count(simulator.advance(now))
        magnetometer.put(simulator.magnetometer())
        imu.put(simulator.imu())  # drives the whole chain, so its companion goes first
        actuation.put(simulator.actuation())
        truth.put(simulator.truth())

    def measure_pressure(now: int) -> None:
        count(simulator.advance(now))
        pressure.put(simulator.pressure())

    def measure_battery(now: int) -> None:
        count(simulator.advance(now))
        battery.put(simulator.battery())
        if simulator.battery_empty:
            node.count("empty:battery")

    node.each(topics.THRUSTERS, obey)
    node.every(topics.PRESSURE.hz, measure_pressure)
    node.every(topics.IMU.hz, measure_motion)
    node.every(topics.BATTERY.hz, measure_battery)
    node.every(REMEMBER_HZ, lambda _: node.remember(simulator.world()))


def _simulator(node: Node, stack: Stack) -> Simulator:
    """Where the world was left before a crash, else at the surface."""
    vehicle = stack.section("vehicle", Vehicle)
    settings = stack.section("simulator", Settings)
    world = node.recall(World)
    if world is not None and not world.fits(vehicle):
        node.count("malformed:memory")
        world = None
    try:
        return Simulator(vehicle, settings, stack.seed, world or at_the_surface(vehicle, settings))
    except ValueError as error:
        raise LindyError(f"{stack.vehicle_path}: {error}") from None
