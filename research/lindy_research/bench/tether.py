"""What the tether costs, whether its models keep to their formulas, and what the real process adds.

The first part needs no network. The second starts two hubs and the tether as processes: commands
that are heard beyond the tether take turns with messages that a neighbour in their own realm hears
(one Zenoh hop), so whatever else the machine does hits both.
"""

import time
import tracemalloc
from collections.abc import Callable, Iterator
from math import exp, sqrt
from pathlib import Path
from tempfile import TemporaryDirectory

import msgspec
import numpy as np

from lindy.api.dives import Registry, Stack, VirtualHost
from lindy.api.links import named
from lindy.api.messages import LinkStatus, PilotCommand, Qos, topics
from lindy_research.bench.table import Figure
from lindy_research.bench.timing import race
from services.runtime.bus.envelope import Envelope
from services.runtime.bus.zenoh_bus import open_bus
from services.runtime.hosts.stack_file import ServiceSpec
from services.runtime.launch.local_stack import local_stack
from services.runtime.launch.process_plan import Dive
from services.tether.core import Link
from services.tether.link_model import RANK, LinkDirection
from services.tether.profile import (
    Delays,
    DirectionProfile,
    Drawn,
    Exponential,
    Loss,
    Losses,
    Pareto,
    Queue,
    UniformStream,
)

S, MS = 1_000_000_000, 1_000_000  # [ns]
GATEWAY = ServiceSpec(sides=["topside", "drone"], gateway=True)
WANTED_HZ = 5000.0  # [1/s] messages through one core
BYTES = 200
DRAWS = 100_000
KOLMOGOROV_99, NORMAL_99 = 1.628, 2.576  # [-] [σ] bands that hold 99 %
FAST = [t for t in topics.ALL if t.way is topics.UP and t.hz >= 50]
RATE_HZ, SECONDS = 100.0, 15.0  # of the real run, both kinds of message together
DELAY_MS = 50.0
CROSSES, STAYS = topics.PILOT_COMMAND, topics.IMU  # only the keys matter


def figures() -> list[Figure]:
    return [*_speed(), *_statistics(), *_overload(), *_thinning(), *_real()]


def _figure(name: str, unit: str, ours: float, **more: object) -> Figure:
    return Figure(section="tether", name=name, unit=unit, ours=ours, **more)  # type: ignore[arg-type]


# Without a network.


def _speed() -> Iterator[Figure]:
    profile = named("severe").profile.up
    model, service = race(lambda: _through_model(profile), _through_service, repeats=5)
    limit = 1e6 / WANTED_HZ
    other = f"{WANTED_HZ:g} messages/s"
    for name, cost in (("model, severe", model), ("service and bus, tether", service)):
        yield _figure(
            name, "µs/msg", cost / 1e3, baseline_name=other, baseline=limit, goal=1.0,
            note=f"{1e9 / cost:,.0f} messages/s",
        )  # fmt: skip


def _through_model(leg: DirectionProfile, count: int = 5000) -> int:
    line: LinkDirection[int] = LinkDirection(leg, np.random.default_rng(1))
    for k in range(count):
        now = k * 5 * MS
        line.enter(k, now, BYTES, k % 4)
        while line.leave(now) is not None:
            pass
    return count


def _through_service(seconds: float = 1.0) -> int:
    """5000 messages a second over all fast rows, with the virtual host and its bus."""
    host = VirtualHost()
    host.add("tether", GATEWAY, Stack(link="tether"))
    drone, heard = host.side("drone"), list[Envelope]()
    for topic in FAST:
        host.side("topside").hear(topic.key, heard.append)
    clock = host.node("clock", ["drone"])
    envelopes = [Envelope(topic.key, bytes(BYTES), topic.encoding) for topic in FAST]

    def say(_: int) -> None:
        for k in range(50):
            drone.forward(envelopes[k % len(envelopes)])

    clock.every(100.0, say)
    host.run(round(seconds * S))
    return max(1, len(heard))


SHAPES: list[tuple[Drawn, Callable[[float], float]]] = [
    (Exponential(12.0), lambda x: 1.0 - exp(-x / 12.0)),
    (Pareto(10.0, 3.0), lambda x: 1.0 - (1.0 + x / 20.0) ** -3.0),
]


def _statistics() -> Iterator[Figure]:
    """Distance from the formula, against the band that holds 99 % of honest samples."""
    for seed, (spread, cdf) in enumerate(SHAPES):
        delays = Delays(spread, np.random.default_rng(seed))
        ordered = np.sort([delays.next_ms() for _ in range(DRAWS)])
        expected = np.array([cdf(x) for x in ordered.tolist()])
        steps = np.arange(DRAWS + 1) / DRAWS
        away = max(float(np.max(steps[1:] - expected)), float(np.max(expected - steps[:-1])))
        name = f"{type(spread).__name__.lower()} delay, distance from its formula"
        yield _band(name, away, KOLMOGOROV_99 / sqrt(DRAWS))
    model = Loss(to_bad=0.02, to_good=0.25)
    decide = Losses(model, UniformStream(np.random.default_rng(7)))
    lost = sum(decide.reason() is not None for _ in range(DRAWS)) / DRAWS
    memory = 1.0 - model.to_bad - model.to_good
    spread_of_share = sqrt(model.mean * (1.0 - model.mean) / DRAWS * (1 + memory) / (1 - memory))
    yield _band("Gilbert–Elliott loss", abs(lost - model.mean), NORMAL_99 * spread_of_share)


def _band(name: str, away: float, band: float) -> Figure:
    return _figure(name, "", away, baseline_name="99 % band", baseline=band, goal=1.0)


def _overload(minutes: int = 10) -> Iterator[Figure]:
    """Four times what the link can carry, for ten minutes; losses are taken as the service does."""
    leg = DirectionProfile(delay_ms=30.0, rate_kbit=100.0, queue=Queue(limit_bytes=20_000))
    line: LinkDirection[bytes] = LinkDirection(leg, np.random.default_rng(1))
    most, kept = 0, list[int]()
    tracemalloc.start()
    for k in range(minutes * 60 * 250):
        now = k * 4 * MS
        line.enter(bytes(BYTES), now, BYTES, RANK[Qos.LIVE])
        while line.leave(now) is not None:
            pass
        line.take_lost()
        most = max(most, line.on_the_way)
        if now % (200 * MS) == 0:
            line.report(now)
        if now % (60 * S) == 59 * S:
            kept.append(tracemalloc.get_traced_memory()[0])
    tracemalloc.stop()
    limit = 20_000 / BYTES + 1 + 30 // 16 + 1
    yield _figure(
        "ten minutes of overload, most on the way", "messages", most,
        baseline_name="queue and flight", baseline=limit, goal=1.0,
    )  # fmt: skip
    yield _figure(
        "the same, memory at the end", "kB", kept[-1] / 1e3,
        baseline_name="after a minute", baseline=kept[0] / 1e3, goal=1.05,
    )  # fmt: skip


def _thinning() -> Iterator[Figure]:
    """A drone's full telemetry on the link `congested`, after five seconds to settle."""
    with_tiers, without = _congested(thin=True), _congested(thin=False)
    for topic in (topics.THRUSTERS, topics.STATE, topics.STATUS):
        ours, other = with_tiers.get(topic.key, []), without.get(topic.key, [])
        yield _figure(
            f"congested, {topic.key} p99", "ms", _percentile(ours, 99),
            baseline_name="not thinned out",
            baseline=_percentile(other, 99) if other else None,
            goal=1.1 if topic is topics.THRUSTERS else 1.0,
            note=f"{len(ours)} arrive, {len(other)} not thinned out",
        )  # fmt: skip


def _congested(*, thin: bool, seconds: float = 30.0) -> dict[str, list[float]]:
    """[ms] Delays by topic. Every message has 200 B, every one of the fast rows 100 Hz."""
    profile = msgspec.structs.replace(named("congested").profile, thin=thin)
    link: Link[tuple[str, int]] = Link("congested", profile, 1)
    rows = [t for t in topics.ALL if t.way is topics.UP and t.hz > 0 and t.hz != 50]
    delays: dict[str, list[float]] = {}
    for tick in range(round(seconds * 100)):
        now = tick * 10 * MS
        _let_out(link, now, delays)
        if tick % 20 == 0:
            link.judge(now)
        for topic in rows:
            due = tick % max(1, round(100.0 / topic.hz)) == 0
            if due and link.admits_up(topic.key, BYTES, now):
                link.up.enter((topic.key, now), now, BYTES, RANK[topic.qos])
    return delays


def _let_out(link: Link[tuple[str, int]], until: int, delays: dict[str, list[float]]) -> None:
    while (due := link.up.due()) is not None and due <= until:
        while (arrival := link.up.leave(due)) is not None:
            key, entered = arrival.item
            if entered >= 5 * S:
                delays.setdefault(key, []).append((due - entered) / MS)
    link.up.take_lost()


# With processes.


def _real() -> Iterator[Figure]:
    direct, beyond, _ = _run("perfect")
    for percent in (50, 99):
        hop, through = _percentile(direct, percent), _percentile(beyond, percent)
        yield _figure(
            f"added by the process, p{percent}", "ms", through - hop,
            baseline_name="one Zenoh hop", baseline=hop, goal=2.5,
            note=f"{len(beyond)} of {len(direct)} arrive",
        )  # fmt: skip
    with TemporaryDirectory() as folder:
        path = Path(folder) / "steady.toml"
        path.write_text(f"[down]\ndelay_ms = {DELAY_MS}\n")
        _, _, statuses = _run(str(path))
    errors = [(s.down_link.delay_p50_ms, s.down_link.delay_p99_ms) for s in statuses]
    p50s = [p50 - DELAY_MS for p50, _ in errors if p50 is not None]
    worst = [p99 - DELAY_MS for _, p99 in errors if p99 is not None]
    # Of the ten commands in a period the p99 is the largest; all ten are below the 99th percentile
    # in 0.99¹⁰ of the periods.
    share = 100.0 * 0.99 ** (RATE_HZ / 2 / topics.LINK.hz)
    for name, late, limit in (
        ("p50", _percentile(p50s, 50), 0.3),
        ("p99", _percentile(worst, share), 2.0),
    ):
        yield _figure(
            f"release later than the model says, {name}", "ms", late,
            baseline_name="limit", baseline=limit, goal=1.0,
        )  # fmt: skip


def _run(link: str) -> tuple[list[float], list[float], list[LinkStatus]]:
    """Commands through a tether process, and as many messages to a neighbour.

    Returns:
        [ms] until the neighbour hears, [ms] until a command is heard beyond the tether, and what
        the tether said of itself meanwhile.
    """
    with TemporaryDirectory() as folder:
        stack = Stack(link=link, out=folder)
        with local_stack(Dive(stack, Registry.read().only({"tether": GATEWAY}))) as local:
            local.start_services()

            def look() -> bool:
                local.pump()
                return True

            local.wait_alive(30.0, look)
            vehicle, ends = stack.drone_name, local.plan.endpoints
            with (
                open_bus(ends["topside"], vehicle) as pilot,
                open_bus(ends["topside"], vehicle) as neighbour,
                open_bus(ends["drone"], vehicle) as drone,
            ):
                near, far = list[tuple[int, Envelope]](), list[tuple[int, Envelope]]()
                said = list[Envelope]()
                neighbour.hear(STAYS.key, lambda e: near.append((time.monotonic_ns(), e)))
                drone.hear(CROSSES.key, lambda e: far.append((time.monotonic_ns(), e)))
                drone.hear(topics.LINK.key, said.append)
                _speak(pilot.say(CROSSES), pilot.say(STAYS))
    statuses = [msgspec.msgpack.decode(e.payload, type=LinkStatus) for e in said]
    return _delays(near), _delays(far), statuses[5:-1]


def _speak(across: Callable[[bytes], None], near: Callable[[bytes], None]) -> None:
    """In turns, at fixed times, then a rest until the last has arrived."""
    time.sleep(1.0)  # the first puts of a session find no routes yet
    begin = time.monotonic_ns()
    for k in range(round(RATE_HZ * SECONDS)):
        time.sleep(max(0.0, (begin + k * S / RATE_HZ - time.monotonic_ns()) / S))
        stamp = time.monotonic_ns()
        command = PilotCommand(seq=k, stamp_ns=stamp, surge=0.0, sway=0.0, heave=0.0, yaw=0.0)
        (near if k % 2 else across)(msgspec.msgpack.encode(command))
    time.sleep(0.3)


def _delays(heard: list[tuple[int, Envelope]]) -> list[float]:
    """[ms] Arrival minus stamp, without the first half second."""
    decode = msgspec.msgpack.Decoder(PilotCommand).decode
    commands = [(at, decode(envelope.payload)) for at, envelope in heard]
    return [(at - c.stamp_ns) / MS for at, c in commands if c.seq >= RATE_HZ / 2]


def _percentile(values: list[float], percent: float) -> float:
    return float(np.percentile(values, percent)) if values else float("inf")
