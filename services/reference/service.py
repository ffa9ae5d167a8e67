"""Reference service: sticks and requests in, one smooth reference out per state."""

from collections.abc import Callable

from messages import events, topics
from messages.pilot import MANOEUVRES, PilotAnswer, PilotRequest
from messages.sensors import AltitudeSample, DvlSample
from messages.state import VehicleState
from services.marine.vehicle import Vehicle
from services.reference.core import GuidanceCheckpoint, ReferenceGenerator, Settings
from services.reference.failsafe.table import WatchedMessages
from services.reference.guidance.requests import refused
from services.reference.trajectory.own_law import Law
from services.runtime.config.identity import identity_of
from services.runtime.config.stack import Stack
from services.runtime.node.node import Node
from services.runtime.node.peers import Peers
from services.vehicle.mounting import AltitudeAtOrigin

SILENCE_S = 0.1  # [s] without a state: stop smoothly and hold


def wire(  # noqa: C901 - one port after the other
    node: Node, stack: Stack, law: Law | None = None
) -> None:
    """
    Args:
        law: of the user's, by which depth and heading go to the velocity of the stick.
    """
    before = node.restore_checkpoint(GuidanceCheckpoint) or GuidanceCheckpoint()
    settings = stack.section("reference", Settings)
    vehicle = stack.section("vehicle", Vehicle)
    generator = ReferenceGenerator(
        settings, node.outbox, before, node.now(), stack.watched, vehicle.output, law
    )
    commands = node.latest(topics.PILOT_COMMAND)
    commands.obey(generator.authority)
    # What the failsafes watch.
    conditions = generator.conditions
    node.each(topics.CLOCK_PING, lambda _, now: conditions.ping(now))
    node.each(topics.HEALTH, conditions.health)
    wrench, battery = node.latest(topics.WRENCH), node.latest(topics.BATTERY)
    leak, dvl = node.latest(topics.LEAK), node.latest(topics.DVL)
    temperature, altimeter = node.latest(topics.TEMPERATURE), node.latest(topics.ALTITUDE)
    of_dvl = AltitudeAtOrigin[DvlSample](
        vehicle.mounting.dvl.position, lambda: node.tell(events.FROZEN(topics.DVL.key))
    )
    of_altimeter = AltitudeAtOrigin[AltitudeSample](
        vehicle.mounting.altimeter.position, lambda: node.tell(events.FROZEN(topics.ALTITUDE.key))
    )

    reference = node.publisher(topics.REFERENCE)
    status = node.publisher(topics.STATUS)
    unfit = _unfit(node, stack)
    published: tuple[object, ...] = ()
    saved = generator.checkpoint

    def on_state(state: VehicleState | None, now: int) -> None:
        attitude = None if state is None else state.attitude
        depth = state.depth.value if state is not None and state.depth.valid else None
        conditions.newest = WatchedMessages(  # a wet detector that falls silent is still wet
            wrench=wrench.newest(now),
            battery=battery.newest(now),
            leak=leak.newest(now),
            temperature=temperature.newest(now),
            dvl=of_dvl.of(dvl.fresh(now), attitude, depth),
            altimeter=of_altimeter.of(altimeter.fresh(now), attitude, depth),
        )
        if (out := generator.step(state, commands.fresh(now), now)) is not None:
            reference.put(out)
        save()
        if published != generator.summary(now):
            publish_status(now)

    def decide(request: PilotRequest, now: int) -> PilotAnswer:
        return unfit(request, now) or generator.answer(request, commands.fresh(now), now)

    def report(request: PilotRequest, answer: PilotAnswer, now: int) -> None:
        if answer.accepted:
            node.log("info", f"{request.kind}: {'begun' if request.kind in MANOEUVRES else 'done'}")
        else:
            node.log("warning", f"{request.kind} refused: {answer.reason}")
        save()
        publish_status(now)

    def save() -> None:
        nonlocal saved
        if saved != generator.checkpoint:
            saved = generator.checkpoint
            node.save_checkpoint(saved)

    def publish_status(now: int) -> None:
        nonlocal published
        published = generator.summary(now)
        status.put(generator.status(now))

    def take_over(request: PilotRequest, now: int) -> None:
        """Do what control has done while this service was silent."""
        if generator.handed_on(request, now):
            node.log("warning", f"{request.kind}: was done by control, and is now done here")
            publish_status(now)

    node.trigger(topics.STATE, on_state, SILENCE_S)
    node.answers(topics.PILOT_REQUEST, topics.PILOT_ANSWER, decide, report)
    node.each(topics.HANDED_ON, take_over)
    node.every(topics.STATUS.hz, publish_status)


def _unfit(node: Node, stack: Stack) -> Callable[[PilotRequest, int], PilotAnswer | None]:
    """Refuses to arm while another Lindy is on the other side, or a service runs twice on board."""
    me, now = node.instance, node.now()
    peers = Peers(identity_of(stack, "drone", me.number))
    if stack.apart:
        peers.expect(now)

    def speak(now: int) -> None:
        if me.number:  # a service does not hear itself
            peers.speaks(node.name, me.number, me.pid, now)

    def unfit(request: PilotRequest, now: int) -> PilotAnswer | None:
        why = peers.wrong(now) if request.kind == "arm" else ""
        return refused(request, why, now) if why else None

    speak(now)
    node.every(topics.HEALTH.hz, speak)
    node.each(topics.IDENTITY, peers.identity)
    node.each(topics.HEALTH, peers.health)
    return unfit
