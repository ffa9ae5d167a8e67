"""`report.json`: a dive in numbers. Its keys are fixed, so that tools can rely on them."""

from collections import Counter
from collections.abc import Mapping, Sequence
from math import degrees
from statistics import median

import msgspec

from messages import events
from messages.events import Promise, row_of, short
from tools.analysis.dive import RecordedDive, read_dive
from tools.analysis.figures import (
    ActedReaction,
    Energy,
    energy,
    error_rms,
    failsafes,
    peak_jerk_ratio,
)
from tools.analysis.latency import (
    Clocks,
    LatencyReport,
    PictureReport,
    ReportedBudget,
    budget,
    clocks,
    further_pictures,
    latency,
    picture,
)
from tools.analysis.losses import losses
from tools.analysis.spectra import Smoothness, smoothness
from tools.analysis.stops import StickStop, stops
from tools.health_sums import HealthSums
from tools.recordings.recording import Recording

NAMED = 3  # services by name; of more only the number


def counted(counts: Mapping[str, int]) -> list[str]:
    """What the services' counts say.

    Args:
        counts: name → times, as in a report's losses.
    """
    there = {name: count for name, count in counts.items() if count}
    broken: dict[Promise, dict[str, int]] = {}
    for name, count in there.items():
        if (promise := row_of(name).breaks) is not None:
            broken.setdefault(promise, {})[name] = count
    refused = sum(broken.get("understood", {}).values())
    if any(row_of(name) is events.DAMAGED for name in there):  # then it is nobody's fault
        refused = 0
    each = {
        promise: [f"{short(name)} {times(n)}" for name, n in names.items()]
        for promise, names in broken.items()
    }
    return [
        *each.get("piloted", []),
        *_few(each.get("answered", []), "services did not answer"),
        *[f"{refused} message{'s' * (refused > 1)} refused"] * (refused > 0),
        *["not everything was recorded"] * ("recorded" in broken),
    ]


def processes(
    restarts: Mapping[str, int], gone: Sequence[str], shared: Mapping[str, str]
) -> list[str]:
    """
    Args:
        restarts: times each service and hub was started again.
        gone: services that were not alive at the end.
        shared: the process of each service that is not alone in a process of its own name.
    """
    again = [f"{name} started again {times(n)}" for name, n in by_process(restarts, shared).items()]
    missing = [f"{name} not alive at the end" for name in gone]
    return [
        *_few(again, "processes started again"),
        *_few(missing, "services not alive at the end"),
    ]


def ending(exit_reason: str, troubles: Sequence[str]) -> str:
    """How a dive ended, in words: cleanly only without any trouble.

    Args:
        exit_reason: `clean`, or why it was aborted.
    """
    if exit_reason != "clean":
        return f"broke off: {exit_reason}"
    return f"ended; {', '.join(troubles)}" if troubles else "ended cleanly"


def by_process(restarts: Mapping[str, int], shared: Mapping[str, str]) -> dict[str, int]:
    """Times each process was started again, of those that were. Arguments as of `processes`."""
    most: dict[str, int] = {}
    for name, count in restarts.items():
        process = shared.get(name, name)
        most[process] = max(count, most.get(process, 0))
    return {process: count for process, count in sorted(most.items()) if count}


def _few(each: Sequence[str], together: str) -> Sequence[str]:
    return each if len(each) <= NAMED else [f"{len(each)} {together}"]


def times(count: int) -> str:
    """In words."""
    return "once" if count == 1 else f"{count} times"


class Extras(msgspec.Struct, frozen=True):
    """What is not in the recording, from the program that ran the dive."""

    exit: str = "clean"  # or the reason
    restarts: dict[str, int] = {}  # service → times it was started again
    shared: dict[str, str] = {}  # service → OS process, where it shares one
    losses: dict[str, int] = {}  # counted by the supervisor itself
    gone: list[str] = []  # services that were not alive at the end
    finished: bool = True  # the recorder ended its file itself
    health: dict[str, HealthSums] = {}  # also of services the recorder does not receive: itself
    speedup: float | msgspec.UnsetType = msgspec.UNSET  # [-] virtual over real time; simulate only
    log_hash: str | msgspec.UnsetType = msgspec.UNSET  # SHA-256; simulate only


TOPSIDES = "supervisor_topside"  # each topside of two machines has one


class Service(msgspec.Struct, frozen=True):
    """Figures over a dive. None: not known, as on virtual time."""

    sent: int  # messages
    lateness_p50_ms: float | None  # [ms] median over the seconds of each second's median
    lateness_p99_ms: float | None  # [ms] median over the seconds of each second's 99th percentile
    cpu_percent: float | None  # [%] of one core, mean
    rss_mb: float | None  # [MB] most
    restarts: int  # with its process
    process: str | None  # the OS process it shares with others; None: one of its own


class Stream(msgspec.Struct, frozen=True):
    count: int  # messages recorded
    hz: float | None  # [1/s] between the first and the last; None: fewer than two


class Hole(msgspec.Struct, frozen=True):
    """A time without any message, since the drone was first armed, or, if it never was, since the
    first message."""

    begin: float  # [s]
    end: float  # [s]


class Report(msgspec.Struct, frozen=True, kw_only=True):
    """Definitions are in the modules the values come from. None: not measurable on this dive."""

    seconds: float  # [s] first to last message
    armed_seconds: float  # [s] of them, armed
    drone: str  # its name
    vehicle: str  # its type
    link: str
    services: dict[str, Service]  # by name
    topics: dict[str, Stream]  # by key
    latency_ms: LatencyReport  # [ms]
    budget_ms: ReportedBudget  # [ms] the same as the link monitor measured it, stage by stage
    clocks: Clocks  # topside and drone
    stops: list[StickStop]  # one per stick release on heave or yaw
    failsafes: list[ActedReaction]  # what the drone did by itself
    depth_error_rms_m: float | None  # [m] true depth minus reference, while armed
    heading_error_rms_deg: float | None  # [°] true heading minus reference, while armed
    peak_jerk_ratio: float | None  # [-] largest |reference jerk| over the limit in force
    smoothness: Smoothness  # jerk as felt, and the thrusters' work
    energy: Energy
    holes: list[Hole]  # times in which nothing was recorded
    losses: dict[str, int]  # everything dropped, stale, expired, clamped …; by name
    troubles: list[str]  # why it did not end cleanly, in words; empty: it did
    exit: str  # "clean" or the reason
    speedup: float | msgspec.UnsetType = msgspec.UNSET
    log_hash: str | msgspec.UnsetType = msgspec.UNSET
    picture: PictureReport | msgspec.UnsetType = msgspec.UNSET  # where there is a camera
    further_pictures: dict[str, PictureReport] | msgspec.UnsetType = msgspec.UNSET  # by camera


def make_report(recording: Recording, extras: Extras) -> Report:
    """Read a recording and report on it."""
    return report_on(read_dive(recording), extras)


def report_on(dive: RecordedDive, extras: Extras) -> Report:
    """Report on a dive that was read already."""
    health = {**extras.health, **dive.health}  # of services that are not in it from elsewhere
    # On board: a topside that came after another has new services, and none of them crashed.
    later = health.get(TOPSIDES, HealthSums()).restarts
    figures = {
        name: _service(health.get(name, HealthSums()), name, extras, later)
        for name in sorted(set(health) | set(extras.restarts))
    }
    # The recorder's own counts are in its file since its last restart, and in `Health` from before;
    # the larger of both is kept.
    counts = losses(health, {"recorder": dive.losses}) + Counter(extras.losses)
    # Counts come once a second: what acted in the last one, only the vehicle's status says.
    acted = failsafes(dive)
    counts |= Counter({events.FAILSAFE_ACTED(each.condition).name: 1 for each in acted})
    lost = dict(sorted(counts.items()))
    began_ns = dive.first_ns if dive.armed_utc_ns is None else dive.armed_utc_ns
    heading_error = error_rms(dive, "yaw")
    return Report(
        seconds=dive.seconds,
        armed_seconds=dive.armed_seconds,
        drone=dive.about.get("drone") or dive.about.get("vehicle", ""),  # older ones had no name
        vehicle=dive.about.get("vehicle", ""),
        link=dive.about.get("link", ""),
        services=figures,
        topics={key: Stream(t.count, t.hz) for key, t in sorted(dive.traffic.items())},
        latency_ms=latency(dive),
        budget_ms=budget(dive),
        clocks=clocks(dive),
        stops=stops(dive),
        failsafes=acted,
        depth_error_rms_m=error_rms(dive, "heave"),
        heading_error_rms_deg=None if heading_error is None else degrees(heading_error),
        peak_jerk_ratio=peak_jerk_ratio(dive),
        smoothness=smoothness(dive),
        energy=energy(dive),
        holes=[
            Hole(round((begin - began_ns) / 1e9, 2), round((end - began_ns) / 1e9, 2))
            for begin, end in dive.holes
        ],
        losses=lost,
        troubles=_troubles(dive, figures, lost, extras),
        exit=extras.exit,
        speedup=extras.speedup,
        log_hash=extras.log_hash,
        picture=picture(dive),
        further_pictures=further_pictures(dive),
    )


def encode(report: Report) -> bytes:
    """The text of `report.json`."""
    return msgspec.json.format(msgspec.json.encode(report), indent=2) + b"\n"


def _troubles(
    dive: RecordedDive, figures: dict[str, Service], lost: dict[str, int], extras: Extras
) -> list[str]:
    """In the order of importance."""
    restarts = {name: service.restarts for name, service in figures.items()}
    silent = max(dive.vehicle_silences, default=0.0)
    # The supervisor's errors are about restarts and silences, which are troubles of their own.
    errors = {s: n for s, n in sorted(dive.errors.items()) if not s.startswith("supervisor")}
    return [
        *([] if dive.armed_seconds > 0.0 else ["never armed"]),
        *([f"the vehicle was silent for {silent:.1f} s"] if silent > 0.0 else []),
        *processes(restarts, extras.gone, extras.shared),
        *counted(lost),
        *(["the recording has a gap"] if dive.holes else []),
        *([] if extras.finished else ["the recording was not finished"]),
        *(f"{service} logged {n} error{'s' * (n > 1)}" for service, n in errors.items()),
    ]


def _service(sums: HealthSums, name: str, extras: Extras, topsides: int) -> Service:
    known = sums.restarts - (topsides if sums.side == "topside" else 0)
    cpu_percent = sums.mean_cpu_percent
    return Service(
        sent=sums.sent,
        lateness_p50_ms=_median(sums.lateness_p50_ms),
        lateness_p99_ms=_median(sums.lateness_p99_ms),
        cpu_percent=None if cpu_percent is None else round(cpu_percent, 1),
        rss_mb=sums.rss_mb,
        restarts=max(extras.restarts.get(name, 0), known),
        process=extras.shared.get(name),
    )


def _median(values: Sequence[float]) -> float | None:
    return round(median(values), 3) if values else None
