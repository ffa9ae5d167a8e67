"""What a film of a dive costs, and how true its times are.

A simulated dive with a camera, over a link that makes its bitrate change. Beside `lindy log film`:
ffmpeg, which copies the finished film. Costs are processor times of the whole
command; of a film's time, the difference to when the light arrived, picture by picture.
"""

import resource
import shutil
import subprocess
from collections.abc import Iterator
from importlib.util import find_spec
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

from lindy.api.recordings import open_recording
from lindy_research.bench.real_dive import LINDY
from lindy_research.bench.table import Figure
from tools.log.film import pictures

SECONDS = 60.0  # [s] of the dive, armed
DIVE = (
    "--stack", "camera", "--link", "wifi_buoy", "--pilot", "script:first_dive",
    "--seconds", f"{SECONDS:g}", "--set", "simulator.floor_depth=8",
)  # fmt: skip
TICK_MS = 0.1  # [ms] goal
COPIED = 3.0  # [-] goal, beside ffmpeg


def figures() -> list[Figure]:
    if find_spec("av") is None:
        return [_figure("film", "", None, note="no PyAV")]
    with TemporaryDirectory(prefix="lindy-bench-") as folder:
        return list(_figures(Path(folder)))


def _figure(name: str, unit: str, ours: float | None, **more: Any) -> Figure:
    return Figure(section="film", name=name, unit=unit, ours=ours, **more)


def _figures(folder: Path) -> Iterator[Figure]:
    dive = folder / "dive"
    _cpu_s(*LINDY, "simulate", *DIVE, "--out", str(dive))
    film = folder / "film.mp4"
    read = _cpu_s(*LINDY, "log", "info", str(dive))
    copied = _cpu_s(*LINDY, "log", "film", str(dive), "--out", str(film))
    minutes = SECONDS / 60.0
    theirs: float | None = None
    if (program := shutil.which("ffmpeg")) is not None:
        copy = (program, "-v", "error", "-i", str(film), "-c:v", "copy", str(folder / "copy.mp4"))
        theirs = (read + _cpu_s(*copy)) / minutes
    yield _figure(
        "a film of a minute", "s", copied / minutes, goal=COPIED,
        baseline_name="lindy log info and ffmpeg copy", baseline=theirs,
    )  # fmt: skip
    mcap = next(dive.glob("*.mcap"))
    yield _figure(
        "size of the film", "MB", film.stat().st_size / 1e6,
        baseline_name="the whole recording", baseline=mcap.stat().st_size / 1e6,
    )  # fmt: skip
    light = [picture.light_ns for picture in pictures(open_recording(dive))]
    times = _times_ns(film)
    late = [abs((at - light[0]) - (time - times[0])) for at, time in zip(light, times, strict=True)]
    yield _figure(
        "time of a picture in the film against its light, at worst", "ms", max(late) / 1e6,
        baseline_name="goal", baseline=TICK_MS, goal=1.0, note=f"{len(times)} pictures",
    )  # fmt: skip


def _times_ns(film: Path) -> list[float]:
    """[ns] When each picture is shown."""
    import av

    with av.open(str(film)) as opened:
        stream = opened.streams.video[0]
        assert stream.time_base is not None
        unit = float(stream.time_base) * 1e9
        packets = [packet.pts for packet in opened.demux(stream)]
    return [pts * unit for pts in packets if pts is not None]


def _cpu_s(*command: str) -> float:
    """[s] Processor time of a program and its children."""
    before = resource.getrusage(resource.RUSAGE_CHILDREN)
    subprocess.run(command, check=True, stdin=subprocess.DEVNULL, stdout=subprocess.DEVNULL)
    after = resource.getrusage(resource.RUSAGE_CHILDREN)
    return after.ru_utime - before.ru_utime + after.ru_stime - before.ru_stime
