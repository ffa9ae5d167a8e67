"""`lindy log jerk`: the jerk that dives felt, beside what their references asked for."""

import io
from collections.abc import Sequence
from pathlib import Path
from typing import NamedTuple

from messages.text import harmless
from services.runtime.config.errors import LindyError
from tools.choices import NewPicture
from tools.fresh import write_fresh
from tools.log.compare_picture import check_picture
from tools.log.text_table import table
from tools.recordings.progress import reading
from tools.recordings.recording import open_recording
from tools.report.dive import RecordedDive, read_dive
from tools.report.jerk import BAND, AxisSpectra, FeltJerk, Smoothness, axis_spectra, smoothness

AXES = (("heave", "m/s³"), ("yaw", "rad/s³"))
SIZE = (9.0, 7.0)  # [in]
LOWEST, HIGHEST = 0.1, 20.0  # [Hz] drawn


class NamedDive(NamedTuple):
    name: str
    dive: RecordedDive


def jerk(recording: tuple[Path, ...], *, out: NewPicture = None) -> int:
    """The jerk that was felt, beside the jerk that was asked for.

    Each RECORDING is a dive's folder or its MCAP file. Felt: of the IMU's vertical acceleration and
    yaw rate, below 2 Hz, while armed. A vehicle that followed its reference exactly would feel the
    reference's jerk. Beside it how often thrusters started and changed their direction. Dives with
    the same sticks and other settings are drawn side by side.

    Example: lindy log jerk dives/one dives/other --out jerk.png
    """
    if not recording:
        raise LindyError("no recording is named; allowed are one or more")
    if out is not None:
        check_picture(out)
    opened = [open_recording(path) for path in recording]
    with reading("reading", sum(one.size for one in opened)):
        dives = [
            NamedDive(str(path), read_dive(one))
            for path, one in zip(recording, opened, strict=True)
        ]
    print(harmless(as_text(dives)))
    if out is not None:
        write_fresh(out, drawn(dives))
        print(f"written {out}")
    return 0


def as_text(dives: Sequence[NamedDive]) -> str:
    heads = ["recording"]
    for axis, unit in AXES:
        heads += [f"{axis} [{unit}]", "reference", "ratio"]
    heads += ["starts [1/min]", "reversals [1/min]"]
    rows = [[one.name, *_figures(smoothness(one.dive))] for one in dives]
    return f"{table(heads, rows)}\nroot mean square below {BAND:g} Hz, while armed"


def _figures(found: Smoothness) -> list[str]:
    starts, reversals = sum(found.starts_per_minute), sum(found.reversals_per_minute)
    return [*_cells(found.heave), *_cells(found.yaw), f"{starts:.1f}", f"{reversals:.1f}"]


def _cells(felt: FeltJerk | None) -> list[str]:
    if felt is None:
        return ["-", "-", "-"]
    ratio = "-" if felt.ratio is None else f"{felt.ratio:.2f}"
    return [f"{felt.felt:.3f}", f"{felt.reference:.3f}", ratio]


def drawn(dives: Sequence[NamedDive]) -> bytes:
    """A PNG: of each axis the spectra that were felt, and dashed those of the references."""
    from matplotlib.figure import Figure

    figure = Figure(figsize=SIZE, layout="constrained")
    rows = figure.subplots(len(AXES), sharex=True)
    for axes, (axis, unit) in zip(rows, AXES, strict=True):
        for number, (name, dive) in enumerate(dives):
            if (found := axis_spectra(dive, axis)) is not None:
                _draw(axes, found, name, f"C{number}")
        axes.axvline(BAND, color="0.6", linewidth=0.8)
        axes.set_ylabel(f"jerk of {axis}\n[({unit})²/Hz]")
        axes.set_xlim(LOWEST, HIGHEST)
        axes.grid(alpha=0.3)
    rows[-1].set_xlabel("frequency [Hz]")
    if rows[0].lines:
        rows[0].legend(fontsize="small")
    png = io.BytesIO()
    figure.savefig(png, format="png", dpi=110)
    return png.getvalue()


def _draw(axes, found: AxisSpectra, name: str, colour: str) -> None:  # type: ignore[no-untyped-def]
    for spectrum, style, what in ((found.felt, "-", "felt"), (found.reference, "--", "reference")):
        shown = (spectrum.frequency >= LOWEST) & (spectrum.density > 0.0)
        if shown.any():
            axes.loglog(
                spectrum.frequency[shown],
                spectrum.density[shown],
                style,
                color=colour,
                linewidth=1.2,
                label=f"{name}: {what}",
            )
