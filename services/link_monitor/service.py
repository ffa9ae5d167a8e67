"""Link monitor: sends pings to the drone, where they are answered; from the answers it estimates
the clock offset, measures latencies and raises the link alarm.

Where topside and drone are two machines it runs on both: topside it measures, on board it answers.
"""

from messages import topics
from messages.link import ClockPing, ClockPong
from services.link_monitor.core import LinkMonitor
from services.link_monitor.ping_responder import pong
from services.runtime.config.stack import Stack
from services.runtime.node.node import Node

TOPSIDE, DRONE = "topside", "drone"


def wire(node: Node, _: Stack) -> None:
    if TOPSIDE in node.sides:
        _measure(node)
    if DRONE in node.sides:
        _answer(node)


def _measure(node: Node) -> None:
    monitor = LinkMonitor()
    budget = monitor.budget
    pings = node.publisher(topics.CLOCK_PING)
    clocks = node.publisher(topics.CLOCK)
    budgets = node.publisher(topics.LATENCY)

    def ping(now: int) -> None:
        pings.put(ClockPing(stamp_ns=now))
        clock = monitor.ping(now)
        node.learn_clock(clock)
        clocks.put(clock)
        watch(now)

    def on_pong(pong: ClockPong, now: int) -> None:
        monitor.pong(pong, now)
        watch(now)

    def watch(now: int) -> None:
        """Publish the begin and the end of an alarm at once."""
        for name in monitor.events:
            node.count(name)
        monitor.events.clear()
        if (news := monitor.news(now)) is not None:
            node.log("warning" if news else "info", news or "the link is back to normal")
            report(now)

    def report(now: int) -> None:
        budgets.put(monitor.report(now))

    node.each(topics.CLOCK_PONG, on_pong)
    node.each(topics.PILOT_COMMAND, budget.command, onlooker=True)
    node.each(topics.STATE, budget.state, onlooker=True)
    node.each(topics.REFERENCE, budget.reference, onlooker=True)
    node.each(topics.THRUSTERS, budget.thrusters, onlooker=True)
    node.each(topics.ACTUATION, budget.actuation, onlooker=True)
    node.each(topics.SHOWN, budget.shown, onlooker=True)
    node.every(topics.CLOCK_PING.hz, ping)
    node.every(topics.LATENCY.hz, report)


def _answer(node: Node) -> None:
    pongs = node.publisher(topics.CLOCK_PONG, side=DRONE)

    def on_ping(ping: ClockPing, now: int) -> None:
        pongs.put(pong(ping, now))

    node.each(topics.CLOCK_PING, on_ping, side=DRONE)
