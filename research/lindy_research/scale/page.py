"""`research/measurements/scale.md`, from the measured points and the model.

Pure, but for the points.
"""

from collections.abc import Iterable, Iterator, Sequence
from pathlib import Path

import msgspec

from lindy_research.scale.model import (
    JOIN_S,
    FleetJoin,
    FleetPlan,
    ScaleMiss,
    ScaleModel,
    ScalePoint,
    check,
    core_routers,
    fit,
    halves,
    load,
)
from lindy_research.scale.page_text import PAGE_TEXT
from lindy_research.scale.traffic import FleetTraffic, flown, watched

POINTS = Path(__file__).with_name("points.json")
FLEETS = (20, 100, 1000)  # drones that the model is read for


class MeasuredScale(msgspec.Struct, frozen=True):
    """What a run of `--measure` found."""

    where: str  # the computer, and how busy it was
    points: list[ScalePoint]
    joins: list[FleetJoin]


def measured() -> MeasuredScale:
    return msgspec.json.decode(POINTS.read_bytes(), type=MeasuredScale)


def page() -> str:
    """The whole page."""
    found = measured()
    fitted_to, checked_on = halves(found.points)
    model = fit(fitted_to)
    up, down, looked = flown("drone"), flown("topside"), watched()
    thin = flown("drone", thinned=True)
    return PAGE_TEXT.format(
        where=found.where,
        traffic=_traffic(
            (
                ("up, to its pilot", up),
                ("up, over a thinned link", thin),
                ("down, from its pilot", down),
                ("up, to a computer that runs `lindy drones --watch`", looked),
            ),
            model,
        ),
        idle=f"{100 * model.idle:.2f} %",
        message=f"{1e6 * model.per_message:.1f} µs",
        overhead=f"{model.overhead:.0f}",
        points=len(found.points),
        off=f"{100 * max(_off(check(model, checked_on))):.0f} %",
        joins=_joins(found.joins),
        fleets=_fleets(model, up, down, looked),
        thinned=_fleets(model, thin, down, looked),
        capacity=f"{_capacity(model):,.0f}",
        drones=f"{_capacity(model) / (up + down).messages_hz:,.0f}",
    )


def _capacity(model: ScaleModel) -> float:
    """[1/s] Messages of one router that takes one core."""
    return (1.0 - model.idle) / model.per_message


def _table(heading: str, rows: Iterable[Sequence[str]]) -> str:
    columns = heading.count("|") - 1
    lines = [heading, "|" + "---|" * columns, *(f"| {' | '.join(row)} |" for row in rows)]
    return "\n".join(lines)


def _traffic(rows: Iterable[tuple[str, FleetTraffic]], model: ScaleModel) -> str:
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


def _off(misses: Iterable[ScaleMiss]) -> Iterator[float]:
    """[-] Relative errors, without their sign."""
    for miss in misses:
        yield abs(miss.cores_off)
        yield abs(miss.wire_off or 0.0)


def _joins(joins: Sequence[FleetJoin]) -> str:
    return _table(
        "| drones that join at once | their hubs | known after s | both routers, s | idle, % |",
        (
            (
                f"{join.drones}",
                "clients" if join.clients else "routers, as they are",
                f"not within {JOIN_S:.0f}" if join.seconds is None else f"{join.seconds:.1f}",
                f"{join.router_s:.2f}",
                f"{100 * join.idle_cores:.1f}",
            )
            for join in joins
        ),
    )


def _fleets(
    model: ScaleModel,
    up: FleetTraffic,
    down: FleetTraffic,
    looked: FleetTraffic,
) -> str:
    rows = [_fleet(model, FleetPlan(drones), up, down, looked) for drones in FLEETS]
    return _table(
        "| drones | routers at sites, centre, core | link of a site | router of a site, cores "
        "| router of the centre, cores | core: messages/s | core: each, cores "
        "| who watches all |",
        rows,
    )


def _fleet(
    model: ScaleModel,
    plan: FleetPlan,
    up: FleetTraffic,
    down: FleetTraffic,
    looked: FleetTraffic,
) -> tuple[str, ...]:
    found = load(plan, up, down, looked)
    cores = core_routers(plan, model, found.core)
    each = FleetTraffic(found.core.messages_hz / cores, found.core.payload_hz / cores)
    return (
        f"{plan.drones:,}",
        f"{plan.sites} + {plan.desks} + {cores}",
        _megabits(model.bits_hz(found.site_up)),
        f"{model.cores(found.site):.2f}",
        f"{model.cores(found.desk):.2f}",
        f"{found.core.messages_hz:,.0f}",
        f"{model.cores(each):.2f}",
        _megabits(model.bits_hz(found.watcher)),
    )


def _megabits(bits_hz: float) -> str:
    return f"{bits_hz / 1e6:,.2g} Mbit/s" if bits_hz < 1e7 else f"{bits_hz / 1e6:,.0f} Mbit/s"
