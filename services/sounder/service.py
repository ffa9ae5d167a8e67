"""Sounder service: pings go down the tether; clocks, latencies and alarms come of the answers."""

from messages import topics
from messages.link import ClockPing, ClockPong
from services.runtime.node import Node
from services.runtime.stack import Stack
from services.sounder.core import Sounder


def wire(node: Node, _: Stack) -> None:
    sounder = Sounder()
    budget = sounder.budget
    pings = node.publisher(topics.CLOCK_PING)
    clocks = node.publisher(topics.CLOCK)
    budgets = node.publisher(topics.LATENCY)

    def ping(now: int) -> None:
        pings.put(ClockPing(stamp_ns=now))
        clock = sounder.ping(now)
        node.learn_clock(clock)
        clocks.put(clock)
        watch(now)

    def on_pong(pong: ClockPong, now: int) -> None:
        sounder.pong(pong, now)
        watch(now)

    def watch(now: int) -> None:
        """An alarm is said at once, and its end too."""
        for name in sounder.happened:
            node.count(name)
        sounder.happened.clear()
        if (news := sounder.news(now)) is not None:
            node.log("warning" if news else "info", news or "the link is as usual again")
            say(now)

    def say(now: int) -> None:
        budgets.put(sounder.report(now))

    node.each(topics.CLOCK_PONG, on_pong)
    node.each(topics.PILOT_COMMAND, budget.command, onlooker=True)
    node.each(topics.STATE, budget.state, onlooker=True)
    node.each(topics.REFERENCE, budget.reference, onlooker=True)
    node.each(topics.THRUSTERS, budget.thrusters, onlooker=True)
    node.each(topics.ACTUATION, budget.actuation, onlooker=True)
    node.each(topics.SHOWN, budget.shown, onlooker=True)
    node.every(topics.CLOCK_PING.hz, ping)
    node.every(topics.LATENCY.hz, say)
