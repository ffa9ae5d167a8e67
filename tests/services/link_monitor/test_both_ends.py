"""One service at both ends of the link: one process on one machine, one on each of two."""

import pytest

from messages import topics
from messages.health import Health
from messages.link import Clock
from services.runtime.config.stack import Stack
from services.runtime.hosts.registry import Registry
from services.runtime.hosts.stack_file import ServiceSpec
from services.runtime.hosts.virtual_host import Skew, VirtualHost
from tools.up import on_side

S = 1_000_000_000  # [ns]
EVERY = Registry.read()
ROWS = EVERY.only({name: EVERY[name] for name in ("tether", "link_monitor")})


@pytest.mark.parametrize("ahead", [None, 0, 3_600 * S])
def test_pings_are_answered_from_the_other_realm_on_one_machine_and_on_two(
    ahead: int | None,
) -> None:
    host = VirtualHost(None if ahead is None else {"drone": Skew(ahead)})
    rows = ROWS if ahead is None else ROWS.apart()
    host.add_all(rows, Stack(link="remote", apart=ahead is not None))
    clocks, health = list[Clock](), dict[str, Health]()
    ears = host.node("ears", ["topside"])
    ears.each(topics.CLOCK, lambda m, _: clocks.append(m))
    ears.each(topics.HEALTH, lambda m, _: health.update({m.service: m}))
    host.run(3 * S)
    assert clocks[-1].rtt_ms is not None
    assert clocks[-1].rtt_ms >= 100.0  # over the link and back, not from neighbour to neighbour
    assert clocks[-1].offset_ns is not None
    assert clocks[-1].bound_ns is not None
    assert abs(clocks[-1].offset_ns - (ahead or 0)) <= clocks[-1].bound_ns
    assert set(rows) <= set(health)


def test_once_the_drone_has_answered_the_topside_says_again_who_it_is_and_its_clock() -> None:
    """What was said before the two have met was heard by nobody."""
    host = VirtualHost({"drone": Skew(5 * S)})
    host.add_all(ROWS.apart(), Stack(link="remote", apart=True))
    said, answered, known = list[int](), list[int](), list[int]()
    ears = host.node("ears", ["topside"])
    ears.each(topics.IDENTITY.of("topside"), lambda _, now: said.append(now))
    ears.each(topics.CLOCK_PONG, lambda _, now: answered.append(now))
    ears.each(topics.CLOCK, lambda m, now: known.append(now) if m.offset_ns is not None else None)
    host.run(3 * S)
    assert said.count(answered[0]) == 1
    assert known[0] == answered[0]


def test_on_two_machines_no_name_is_there_twice() -> None:
    topside, drone = (on_side(EVERY, side, gateway=False) for side in ("topside", "drone"))
    assert set(topside) & set(drone) == set()
    assert topside["link_monitor"] == ServiceSpec(sides=["topside"], service="link_monitor")
    assert drone["link_monitor_drone"] == ServiceSpec(sides=["drone"], service="link_monitor")
