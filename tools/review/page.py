"""The page of a review: one HTML file that loads nothing from elsewhere."""

from base64 import b64encode
from collections.abc import Iterable, Sequence
from html import escape

from tools.review import plots
from tools.review.estimated import in_words
from tools.review.review import Drawn, Review
from tools.review.stick_stops import ReviewedStop
from tools.review.vibration import MOTION_HZ
from tools.review.words import BY, amount, in_short, signed, whose

STYLE = """
body { font: 16px/1.5 system-ui, sans-serif; max-width: 58rem; margin: 2rem auto; padding: 0 1rem;
  color: #222; background: #fff; }
h1 { margin-bottom: 0; } h2 { margin-top: 2.5rem; border-top: 1px solid #ccc; padding-top: 1rem; }
table { border-collapse: collapse; font-size: 0.88rem; margin: 1rem 0; }
th, td { padding: 0.2rem 0.7rem 0.2rem 0; text-align: right; vertical-align: top; }
th { border-bottom: 1px solid #999; font-weight: 600; }
th:first-child, td:first-child, td.words, th.words { text-align: left; }
img { max-width: 100%; } pre { background: #f2f2f2; padding: 0.8rem; overflow-x: auto; }
.missing { background: #fff4d6; padding: 0.5rem 0.8rem; } .about { color: #555; }
.short li { margin: 0.3rem 0; }
"""
SECTIONS = {
    "sensors": "What the recording holds",
    "vibration": "Noise and vibration",
    "estimation": "Where it was: Lindy's estimate",
    "stops": "Every stop",
    "measurements": "What was rejected",
    "stops_with_lindy": "Your stops with Lindy in control",
}
Cell = str | float | None


def page(found: Review, drawn: Drawn) -> str:
    """The HTML."""
    of = f"imported from {found.imported_from}, " if found.imported_from else ""
    armed = "" if found.armed_s is None else f", armed {found.armed_s:.0f} s"
    about = f"{of}vehicle file {found.vehicle}, {found.seconds:.0f} s{armed}"
    bodies = {
        "sensors": _sensors(found),
        "vibration": _vibration(found, drawn),
        "estimation": _estimation(found, drawn),
        "stops": _stops(found, drawn),
        "measurements": _measurements(found, drawn),
        "stops_with_lindy": _with_lindy(found),
    }
    sections = "".join(
        f'<h2 id="{key}">{escape(heading)}</h2>{_missing(found, key)}{bodies[key]}'
        for key, heading in SECTIONS.items()
    )
    short = "".join(f"<li>{escape(line)}</li>" for line in in_short(found))
    remarks = "".join(f'<p class="missing">{escape(line)}</p>' for line in found.remarks)
    return (
        f'<!doctype html><html lang="en"><head><meta charset="utf-8">'
        f'<meta name="viewport" content="width=device-width">'
        f"<title>Review of {escape(found.file)}</title><style>{STYLE}</style></head><body>"
        f'<h1>Your dive, reviewed</h1><p class="about">{escape(found.file)}: {escape(about)}</p>'
        f'{remarks}<h2>In short</h2><ul class="short">{short}</ul>{sections}'
        f'<p class="about">Made by lindy review. The same figures: '
        f"lindy review --json {escape(found.file)}</p></body></html>\n"
    )


def _sensors(found: Review) -> str:
    rows = [
        (s.key.removeprefix("sensor/"), s.samples, s.per_second, s.gaps, s.longest_gap_s,
         s.jitter_ms, s.late_ms, s.latest_ms, "; ".join(s.remarks))
        for s in found.sensors
    ]  # fmt: skip
    heads = ("sensor", "samples", "per second", "gaps", "longest [s]", "jitter [ms]",
             "late [ms]", "latest [ms]", "odd")  # fmt: skip
    return _table(heads, rows, words=1) + _p(
        "Late: from a sample's own stamp to its arrival in the log, the middle and 99 of 100. "
        "Jitter: nine of ten periods differ by less."
    )


def _vibration(found: Review, drawn: Drawn) -> str:
    if drawn.vibration is None:
        return ""
    rows = [
        (a.name, a.unit, a.quiet_density, a.shaken_density, a.shaken_rms, a.peak_hz)
        for a in found.vibration
    ]
    heads = ("axis", "unit", "quiet [/√Hz]", "shaken [/√Hz]", "shaken, rms", "line at [Hz]")
    return (
        _p(
            f"The quietest and the most shaken fifth of the dive, above {MOTION_HZ:g} Hz, where a "
            f"vehicle does not move by itself: what is there is noise, thrusters and frame. A line "
            f"is something that turns or rings."
        )
        + _image(plots.spectra(drawn.vibration), "Spectra of accelerometer and gyroscope")
        + _table(heads, rows)
    )


def _estimation(found: Review, drawn: Drawn) -> str:
    compared = found.estimation.beside
    ours, own = drawn.estimated.track, drawn.recorded.own
    offsets = {each.name: each.offset for each in compared}
    rows = [
        (c.name.replace("_", " "), amount(c.rms, c.unit), amount(c.worst, c.unit),
         signed(c.offset, c.unit) if c.offset else "–", c.samples)
        for c in compared
    ]  # fmt: skip
    heads = ("", "differs, rms", "at most", "taken off", "samples")
    said = f"It knew roll, pitch and depth for {found.estimation.known_s:.0f} s, after "
    said += f"{found.estimation.calibrating_s:.0f} s of calibration."
    table = _table(heads, rows) + _p(
        "Taken off: heading and depth count from two norths and two surfaces."
    )
    drawable = drawn.estimated.runs or own is not None
    return (
        (_p(said) if found.estimation.runs else "")
        + (_image(plots.motion(ours, own, offsets, whose(found)), "The motion over time")
           if drawable else "")
        + (table if rows else "")
        + _list("Sensors that could not be used at times:", found.estimation.troubles)
    )  # fmt: skip


def _stops(found: Review, drawn: Drawn) -> str:
    if not found.stops:
        return ""
    by = dict.fromkeys(BY[stop.by] for stop in found.stops if stop.ran_on is not None)
    return (
        _p(
            f"From the moment the stick was let go{', by ' * bool(by)}{' and '.join(by)}. Jerk is "
            "what a camera feels, below 2 Hz. "
            "Lindy: how far its reference runs on from the same speed, with the limits of the "
            "vehicle file."
        )
        + (
            _image(plots.stops(drawn.stops), "Every stop: the way beyond the release over time")
            if any(curve is not None for _, curve in drawn.stops.found)
            else ""
        )
        + _stop_table(found.stops)
    )


def _stop_table(stops: Sequence[ReviewedStop]) -> str:
    rows: list[Sequence[Cell]] = []
    for s in stops:
        unit = "rad" if s.axis == "yaw" else "m"
        ways = (s.ran_on, s.bounced_back)
        rows.append(
            (
                *(s.axis, s.t, None if s.speed is None else signed(s.speed, f"{unit}/s")),
                *(None if way is None else amount(way, unit) for way in ways),
                *(s.seconds, None if s.jerk is None else amount(s.jerk, f"{unit}/s³")),
                *(None if s.lindy_ran_on is None else amount(s.lindy_ran_on, unit),),
                s.lindy_seconds,
            )
        )
    heads = ("axis", "at [s]", "speed", "ran on", "came back", "at rest after [s]", "jerk",
             "Lindy runs on", "for [s]")  # fmt: skip
    return _table(heads, rows)


def _measurements(found: Review, drawn: Drawn) -> str:
    if not found.measurements:
        return ""
    rows = [
        (in_words(m.name), m.samples, m.rejected, m.not_used, m.lag_one, m.spread_ratio,
         "; ".join(m.words))
        for m in found.measurements
    ]  # fmt: skip
    heads = ("measured", "samples", "rejected", "not used", "correlation", "over expected", "why")
    return (
        _p("The share of each measurement that was used, over time: 1 all, 0 none.")
        + _image(
            plots.used(drawn.estimated.innovations), "Share of each measurement used over time"
        )
        + _table(heads, rows, words=1)
    )


def _with_lindy(found: Review) -> str:
    if not found.stops_with_lindy:
        return ""
    return _p(
        "Your sticks flown again in simulation, by Lindy, on the vehicle that was identified "
        "from this dive. The simulated water is still. Times count from the "
        "beginning of your recording, as in the table above."
    ) + _stop_table(found.stops_with_lindy)


def _missing(found: Review, key: str) -> str:
    return "".join(f'<p class="missing">{escape(line)}</p>' for line in found.missing.get(key, []))


def _table(heads: Sequence[str], rows: Iterable[Sequence[Cell]], words: int = 0) -> str:
    """`words`: how many of the last columns are words."""
    first = len(heads) - words
    head = "".join(f"<th{_is_words(n, first)}>{escape(name)}</th>" for n, name in enumerate(heads))
    body = "".join(
        "<tr>"
        + "".join(f"<td{_is_words(n, first)}>{escape(_cell(c))}</td>" for n, c in enumerate(row))
        + "</tr>"
        for row in rows
    )
    return f"<table><tr>{head}</tr>{body}</table>"


def _is_words(column: int, first: int) -> str:
    return ' class="words"' if column >= first else ""


def _cell(value: Cell) -> str:
    if value is None:
        return "–"
    if isinstance(value, str):
        return value
    return f"{value:d}" if isinstance(value, int) else f"{value:.4g}"


def _p(text: str) -> str:
    return f"<p>{escape(text)}</p>"


def _list(heading: str, lines: Sequence[str]) -> str:
    items = "".join(f"<li>{escape(line)}</li>" for line in lines)
    return f"<p>{escape(heading)}</p><ul>{items}</ul>" if lines else ""


def _image(png: bytes, alt: str) -> str:
    data = b64encode(png).decode()
    return f'<p><img alt="{escape(alt)}" src="data:image/png;base64,{data}"></p>'
