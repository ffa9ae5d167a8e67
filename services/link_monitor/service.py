"""Link monitor: sends pings to the drone, where they are answered; from the answers it estimates
the clock offset, measures latencies and raises the link alarm.

Where topside and drone are two machines it runs on both: topside it measures, on board it answers.
On both it says which Lindy this side runs; topside it compares, and says so where services receive
much that they cannot read. Topside it measures the age of pictures, too, once there are any.
"""

from collections.abc import Callable

from msgspec.structs import replace

from messages import cameras, events, topics
from messages.health import Health
from messages.identity import SideIdentity
from messages.link import ClockPing, ClockPong
from messages.video import VideoPart
from services.link_monitor.core import JunkWatch, LinkMonitor
from services.link_monitor.picture_account import Carried, PictureAccount
from services.marine.field_of_view import CameraViews
from services.runtime.config.identity import identity_of
from services.runtime.config.stack import Stack
from services.runtime.node.node import Node
from services.runtime.node.peers import Peers

TOPSIDE, DRONE = "topside", "drone"
INTRODUCED_HZ = 1.0  # [1/s]


def wire(node: Node, stack: Stack) -> None:
    says = {
        side: _introduce(node, identity_of(stack, side, node.instance.number), side)
        for side in node.sides
    }
    if TOPSIDE in node.sides:
        monitor = LinkMonitor(node.outbox, node.instance.number)
        ping = _measure(node, monitor)
        if stack.apart:
            _once_met(node, says[TOPSIDE], ping)
        _compare(node, monitor, stack)
        carried = Carried()
        for camera in stack.section("camera", CameraViews).by_name:
            _watch(node, camera, PictureAccount(node.outbox, carried))
    if DRONE in node.sides:
        _answer(node)


def _once_met(node: Node, introduce: Callable[[int], None], ping: Callable[[int], None]) -> None:
    """What was said before the two machines have met was not heard: once the drone has answered,
    say at once who this side is, and what its clock is."""
    met = False

    def on_pong(_: ClockPong, now: int) -> None:
        nonlocal met
        if not met:
            met = True
            introduce(now)
            ping(now)

    node.each(topics.CLOCK_PONG, on_pong)


def _introduce(node: Node, ours: SideIdentity, side: str) -> Callable[[int], None]:
    """Say who this side is, with its first word and once a second. Returns what says it."""
    identities = node.publisher(topics.IDENTITY.of(side), side=side)

    def introduce(now: int) -> None:
        identities.put(replace(ours, stamp_ns=now))

    node.alarm(introduce).set(node.now())
    node.every(INTRODUCED_HZ, introduce)
    return introduce


def _compare(node: Node, monitor: LinkMonitor, stack: Stack) -> None:
    """Tell the pilot of a drone with another Lindy, of services on board that run twice, and of
    floods of messages that services cannot read."""
    peers, junk = Peers(identity_of(stack, TOPSIDE, node.instance.number)), JunkWatch()

    def look(now: int) -> None:
        was, monitor.misfit = monitor.misfit, peers.wrong(now)
        if monitor.misfit and monitor.misfit != was:
            node.tell(events.ALARM_PEERS(detail=monitor.misfit))
        elif was and not monitor.misfit:
            node.log("info", "both sides fit together again")
        was, monitor.junk = monitor.junk, junk.notice(now)
        if monitor.junk and not was:
            node.tell(events.ALARM_JUNK(detail=events.detail(monitor.junk)))
        elif was and not monitor.junk:
            node.log("info", "services can read all messages again")

    def on_health(health: Health, now: int) -> None:
        peers.health(health, now)
        junk.health(health, now)

    if stack.apart:
        node.each(topics.CLOCK_PONG, lambda _, now: peers.expect(now))
    node.each(topics.IDENTITY, peers.identity)
    node.each(topics.HEALTH, on_health)
    node.every(topics.LATENCY.hz, look)


def _measure(node: Node, monitor: LinkMonitor) -> Callable[[int], None]:
    """Returns what sends a ping, and publishes the clock."""
    budget = monitor.budget
    pings = node.publisher(topics.CLOCK_PING)
    clocks = node.publisher(topics.CLOCK)
    budgets = node.publisher(topics.LATENCY)

    def ping(now: int) -> None:
        pings.put(ClockPing(stamp_ns=now, source=monitor.source))
        clock = monitor.ping(now)
        node.learn_clock(clock)
        clocks.put(clock)
        watch(now)

    def on_pong(pong: ClockPong, now: int) -> None:
        monitor.pong(pong, now)
        watch(now)

    def watch(now: int) -> None:
        """Publish the begin and the end of an alarm at once."""
        if monitor.news(now):
            report(now)

    def report(now: int) -> None:
        budgets.put(monitor.report(now))

    node.each(topics.CLOCK_PONG, on_pong)
    node.each(topics.PILOT_COMMAND, monitor.command, onlooker=True)
    node.each(topics.STATE, budget.state, onlooker=True)
    node.each(topics.REFERENCE, budget.reference, onlooker=True)
    node.each(topics.THRUSTERS, budget.thrusters, onlooker=True)
    node.each(topics.ACTUATION, budget.actuation, onlooker=True)
    node.each(topics.SHOWN, budget.shown, onlooker=True)
    node.every(topics.CLOCK_PING.hz, ping)
    node.every(topics.LATENCY.hz, report)
    return ping


def _answer(node: Node) -> None:
    pongs = node.publisher(topics.CLOCK_PONG, side=DRONE)

    def on_ping(ping: ClockPing, now: int) -> None:
        answer = ClockPong(stamp_ns=now, ping_ns=ping.stamp_ns, heard_ns=now, source=ping.source)
        pongs.put(answer)

    node.each(topics.CLOCK_PING, on_ping, side=DRONE)


def _watch(node: Node, camera: str, account: PictureAccount) -> None:
    """Measure the pictures of one camera, from the first one on."""
    age = node.publisher(cameras.age(camera))

    def report(now: int) -> None:
        if account.begun:
            age.put(account.report(now))

    def hear(part: VideoPart, now: int) -> None:
        was_whole = not account.broken
        account.take(part, now)
        if account.broken and was_whole:
            report(now)  # at once: it asks for a keyframe

    node.each(cameras.video(camera), hear)
    node.every(topics.PICTURE_AGE.hz, report)
