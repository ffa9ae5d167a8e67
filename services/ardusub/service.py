"""ArduSub service: thruster commands down to a board, sensor samples up from it."""

from collections.abc import Callable

from messages import events, topics
from messages.control import ThrusterCommand
from messages.message import Message
from messages.pilot import PilotRequest
from messages.sensors import (
    BatterySample,
    ImuSample,
    LeakSample,
    MagnetometerSample,
    PressureSample,
    TemperatureSample,
)
from messages.topic import AnyTopic
from services.ardusub.authority import TakenCheckpoint
from services.ardusub.core import HEARD, ArdusubDriver, Settings
from services.marine.vehicle import Vehicle
from services.mavlink_io.io.endpoint import HeardMessages, MavlinkEndpoint
from services.mavlink_io.io.links import ByteLinks, FarEndLimits, Links
from services.runtime.config.errors import NeedsRealTimeError
from services.runtime.config.stack import Stack
from services.runtime.node.node import Node

# What is due is sent, and actuation is reported, with every command: this often where none comes.
TICK_HZ = topics.ACTUATION.hz  # [1/s]
TICK_NS = round(1e9 / TICK_HZ)
CONNECT_HZ = 10.0  # [1/s] what arrives is read at once; this connects again what is lost
SHOW_HZ = 10.0  # [1/s] lights and camera tilt
# Of several that send datagrams, the board is the one that speaks first, as long as it speaks.
ONE_BOARD = FarEndLimits(most=1, silent_s=3.0, beyond=events.STRANGER("mavlink"))
TOPICS: dict[type[Message], AnyTopic] = {
    ImuSample: topics.IMU,
    MagnetometerSample: topics.MAGNETOMETER,
    PressureSample: topics.PRESSURE,
    BatterySample: topics.BATTERY,
}


def wire(node: Node, stack: Stack) -> None:
    """
    Raises:
        LindyError: the port cannot be opened, or pymavlink is not installed.
    """
    if stack.virtual:
        raise NeedsRealTimeError(node.name)
    url = stack.section("ardusub", Settings).url
    wire_to(Links([url], "ardusub.url", ONE_BOARD, node.outbox), node, stack)


def wire_to(links: ByteLinks, node: Node, stack: Stack) -> None:
    """The service on a link that is open."""
    settings = stack.section("ardusub", Settings)
    before = node.restore_checkpoint(TakenCheckpoint)
    driver = ArdusubDriver(stack.section("vehicle", Vehicle), settings, node.outbox, before)
    heard = HeardMessages(settings.board, HEARD)
    board = MavlinkEndpoint(links, node.outbox, settings.system, settings.component, heard=heard)
    pass_on, actuation = _passing_on(driver, board, node), node.publisher(topics.ACTUATION)

    def obey(command: ThrusterCommand, now: int) -> None:
        driver.obey(command, now)
        pass_on()
        ends_ns = driver.path.gate.ends_ns
        end.set(None if ends_ns is None else ends_ns + 1)
        look(now)
        ticking.start(now + TICK_NS)  # the next command comes before

    def hear(request: PilotRequest, now: int) -> None:
        if request.kind == "disarm":
            driver.hear_pilot(request, now)
            pass_on()

    def lapse(now: int) -> None:
        driver.lapse(now)
        pass_on()

    def listen(_: int) -> None:
        packets = board.receive()
        # Not the time it was called for: on a busy computer, what was sent since then may have
        # arrived as well, and a packet that arrives before it was sent looks like a clock that
        # jumped.
        arrival = node.now()
        for packet in packets:
            driver.hear(packet, arrival)
        pass_on()

    def look(now: int) -> None:
        driver.tick(now)
        pass_on()
        actuation.put(driver.actuation(now))

    def close() -> None:
        driver.disarm()
        pass_on()
        links.close()

    end = node.alarm(lapse)
    node.each(topics.THRUSTERS, obey)
    node.each(topics.PILOT_REQUEST, hear)
    ticking = node.every(TICK_HZ, look)
    node.every(CONNECT_HZ, listen)
    _report_the_enclosure(node, driver)
    _show_light_and_tilt(node, driver)
    node.on_close(close)
    links.start(node.from_outside(listen))


def _report_the_enclosure(node: Node, driver: ArdusubDriver) -> None:
    leak, temperature = node.publisher(topics.LEAK), node.publisher(topics.TEMPERATURE)

    def look_inside(now: int) -> None:
        leak.put(LeakSample(stamp_ns=now, wet=driver.wet(now)))
        inside, water = driver.measurements.enclosure, driver.measurements.water
        if inside is not None:
            temperature.put(TemperatureSample(stamp_ns=now, temperature=inside, water=water))

    node.every(topics.LEAK.hz, look_inside)


def _show_light_and_tilt(node: Node, driver: ArdusubDriver) -> None:
    """Both keep their last value on silence."""
    status, reference = node.latest(topics.STATUS), node.latest(topics.REFERENCE)

    def show(now: int) -> None:
        newest, wanted = status.newest(now), reference.newest(now)
        driver.show(newest, wanted.tilt.position if wanted else 0.0)

    node.every(SHOW_HZ, show)


def _passing_on(driver: ArdusubDriver, board: MavlinkEndpoint, node: Node) -> Callable[[], None]:
    """What the driver has to send, to publish and to remember."""
    publishers = {kind: node.publisher(topic) for kind, topic in TOPICS.items()}

    def pass_on() -> None:
        done = driver.take()
        for packet in done.packets:
            board.send(packet)
        for sample in done.samples:
            publishers[type(sample)].put(sample)
        if done.taken is not None:
            node.save_checkpoint(TakenCheckpoint(taken=done.taken))

    return pass_on
