"""`docs/scale.md`, written from the measured points and the model. Pure, but for the points."""

from collections.abc import Iterable, Sequence
from pathlib import Path

import msgspec
import numpy as np

from tools.research.scale.model import (
    Join,
    Model,
    Plan,
    Point,
    check,
    core_routers,
    fit,
    halves,
    load,
)
from tools.research.scale.traffic import Traffic, flown, watched

POINTS = Path(__file__).with_name("points.json")
FLEETS = (20, 100, 1000)  # drones that the model is read for


class Measured(msgspec.Struct, frozen=True):
    """What a run of `--measure` found."""

    where: str  # the computer, and how busy it was
    points: list[Point]
    joins: list[Join]


def measured() -> Measured:
    return msgspec.json.decode(POINTS.read_bytes(), type=Measured)


def page() -> str:
    """The whole page."""
    found = measured()
    fitted_to, checked_on = halves(found.points)
    model = fit(fitted_to)
    up, down, looked = flown("drone"), flown("topside"), watched()
    thin = flown("drone", thinned=True)
    return HEADING.format(
        where=found.where,
        traffic=_traffic(
            (
                ("up, to its pilot", up),
                ("up, over a thinned link", thin),
                ("down, from its pilot", down),
                ("up, to whoever watches all (`lindy fleet`)", looked),
            ),
            model,
        ),
        model=_model(model),
        fitted=_points(model, fitted_to),
        checked=_points(model, checked_on),
        joins=_joins(found.joins),
        fleets=_fleets(model, up, down, looked),
        thinned=_fleets(model, thin, down, looked),
        capacity=f"{_capacity(model):,.0f}",
        drones=f"{_capacity(model) / (up + down).messages_hz:,.0f}",
        exponent=f"{join_exponent(found.joins):.1f}",
        thousand=_minutes(join_s(found.joins, 1000)),
        hundred=_minutes(join_s(found.joins, 100)),
    )


def join_exponent(joins: Sequence[Join]) -> float:
    """With which power of their number the routers' time for drones that join grows."""
    slope, _ = _power(joins)
    return slope


def join_s(joins: Sequence[Join], drones: int) -> float:
    """[s] Processor time of both routers, by that power."""
    slope, start = _power(joins)
    return float(np.exp(start) * drones**slope)


def _power(joins: Sequence[Join]) -> tuple[float, float]:
    numbers = np.log([float(join.drones) for join in joins])
    times = np.log([join.router_s for join in joins])
    slope, start = np.polyfit(numbers, times, 1).tolist()
    return slope, start


def _capacity(model: Model) -> float:
    """[1/s] Messages of one router that takes one core."""
    return (1.0 - model.idle) / model.per_message


def _table(heading: str, rows: Iterable[Sequence[str]]) -> str:
    columns = heading.count("|") - 1
    lines = [heading, "|" + "---|" * columns, *(f"| {' | '.join(row)} |" for row in rows)]
    return "\n".join(lines)


def _traffic(rows: Iterable[tuple[str, Traffic]], model: Model) -> str:
    return _table(
        "| of one drone that is flown | messages/s | payload kB/s | on the wire kbit/s |",
        (
            (
                name,
                f"{traffic.messages_hz:.0f}",
                f"{traffic.payload_hz / 1e3:.1f}",
                f"{model.bits_hz(traffic) / 1e3:.0f}",
            )
            for name, traffic in rows
        ),
    )


def _model(model: Model) -> str:
    return _table(
        "| fitted | |",
        (
            ("a router, while nobody speaks", f"{100 * model.idle:.2f} % of a core"),
            ("a router, for each message that passes", f"{1e6 * model.per_message:.1f} µs"),
            ("on the wire, for each message besides its payload", f"{model.overhead:.0f} bytes"),
        ),
    )


def _points(model: Model, points: Sequence[Point]) -> str:
    return _table(
        "| drones | × rates | messages/s | router, cores | model | off | link kB/s | model | off "
        "| p50 ms | p99 ms |",
        (
            (
                f"{miss.point.drones}",
                f"{miss.point.speed:g}",
                f"{miss.point.messages_hz:.0f}",
                f"{miss.point.cores:.3f}",
                f"{miss.cores:.3f}",
                f"{100 * miss.cores_off:+.0f} %",
                _number(miss.point.wire_hz),
                _number(miss.wire_hz),
                "–" if miss.wire_off is None else f"{100 * miss.wire_off:+.0f} %",
                f"{miss.point.p50_ms:.2f}",
                f"{miss.point.p99_ms:.1f}",
            )
            for miss in check(model, points)
        ),
    )


def _number(bytes_hz: float | None) -> str:
    return "–" if bytes_hz is None else f"{bytes_hz / 1e3:.0f}"


def _joins(joins: Sequence[Join]) -> str:
    return _table(
        "| drones that join at once | known after s | both routers, s of a core | idle, % |",
        (
            (
                f"{join.drones}",
                f"{join.seconds:.1f}",
                f"{join.router_s:.2f}",
                f"{100 * join.idle_cores:.1f}",
            )
            for join in joins
        ),
    )


def _fleets(model: Model, up: Traffic, down: Traffic, looked: Traffic) -> str:
    rows = [_fleet(model, Plan(drones), up, down, looked) for drones in FLEETS]
    return _table(
        "| drones | routers at sites, centre, core | link of a site | router of a site, cores "
        "| router of the centre, cores | core: messages/s | core: each, cores "
        "| who watches all | who records all |",
        rows,
    )


def _fleet(
    model: Model, plan: Plan, up: Traffic, down: Traffic, looked: Traffic
) -> tuple[str, ...]:
    found = load(plan, up, down, looked)
    cores = core_routers(plan, model, found.core)
    each = Traffic(found.core.messages_hz / cores, found.core.payload_hz / cores)
    return (
        f"{plan.drones:,}",
        f"{plan.sites} + {plan.desks} + {cores}",
        _megabits(model.bits_hz(found.site_up)),
        f"{model.cores(found.site):.2f}",
        f"{model.cores(found.desk):.2f}",
        f"{found.core.messages_hz:,.0f}",
        f"{model.cores(each):.2f}",
        _megabits(model.bits_hz(found.watcher)),
        _megabits(model.bits_hz(found.recorder)),
    )


def _megabits(bits_hz: float) -> str:
    return f"{bits_hz / 1e6:,.2g} Mbit/s" if bits_hz < 1e7 else f"{bits_hz / 1e6:,.0f} Mbit/s"


def _minutes(seconds: float) -> str:
    return f"{seconds:.0f} s" if seconds < 120.0 else f"{seconds / 60.0:.0f} min"


HEADING = """# How many drones a network carries

Written by `make docs` from `tools/research/scale`; do not edit. `python -m tools.research.scale` prints it,
`--measure` measures the points anew.

## What a drone sends

From the topic table: the rows that the other side asks for, at their rates. A row that nobody asks for is not
sent. Without video, which is 1 to 8 Mbit/s more for each picture that is watched ([camera.md](camera.md)).

{traffic}

## The model

Two straight lines: a router needs so much of a core for each message that it passes on, and a link carries the
payload and so many bytes more for each message. A message that crosses three routers is counted at each.

{model}

Both are fitted, by least squares of relative errors, to every second of the points below, ordered by their load.
They were measured with synthetic drones and pilots (`python -m tools.fleet.synthetic_fleet`) on two routers, each
a Python process with Zenoh's router and one thread, on {where}. Each drone and each
pilot has a hub of its own, as real ones have. `× rates`: times the table's rates. `link` is the one between both
routers, as the operating system counts its bytes in both directions, without TCP's and IP's headers. The delay is
from a drone to its pilot through both routers; on a busy computer its 99th percentile is that of the processes.

Fitted to:

{fitted}

Checked on, and not fitted to:

{checked}

## Read off

Ten drones at the router of their site, 25 pilots at a router of the centre, core routers between them that take
half a core each at most, and two who watch all with `lindy fleet`. Every drone is flown. Routers are those of the
model, with one thread; zenohd has more.

{fleets}

With every site's link thinned (`lindy router-config --thin`):

{thinned}

One router that takes a whole core passes on {capacity} messages a second, by extrapolation: some {drones} drones
with their pilots. A site's link, not its router, is what limits a site.

## Drones that join

Every drone's hub and every pilot's is a Zenoh router, and each of them learns of each other one.

{joins}

The routers' time grows with the power {exponent} of the number of drones that join at once. By extrapolation
a router that comes back costs both routers {hundred} of a core for 100 drones, and {thousand} for 1,000.

## What breaks first

1. **The uplink of a site.** Ten flown drones are some 14 Mbit/s: more than LTE carries upwards in most places. Thinned
   they are below 4 Mbit/s. Commands are never thinned; they are small.
2. **Who records everything** (`lindy record`): at 100 drones it writes some 42,000 messages a second, and Python
   records about 10,000 on a core. Several of them share the drones (`--drone`), or each drone records on board and
   its files are fetched after the dive, which is what Lindy does without being asked.
3. **All who join again at once**, after the failure of a core router: see above. Sites of ten that meet at a few core
   routers keep each router's list of hubs short only if the hubs connect as clients, which they do not yet.
4. **A core router**: 1,000 drones need several, between which Zenoh does not balance the load; who connects
   where is in the routers' files.

Not what breaks: who watches all (`lindy fleet`), which asks for three slow rows; and the routers of sites and centre.

Not measured: more than two routers in a row, other computers' network cards, TLS (it adds its own cost to every
message), 1,000 real hubs.
"""
