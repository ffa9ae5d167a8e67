"""True age against shown age of pictures from cameras that others wrote, for `bench --only camera`.

Each picture has the time at which it was made in its stripe; what the service says is its light's
stamp. Shown is never younger than true but for the camera's own coding and the quickest way, of
which nobody tells. Starved: a processor that decodes two of five pictures in time.
"""

import shutil
import time
from collections.abc import Generator, Iterator
from contextlib import contextmanager
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import TYPE_CHECKING

import numpy as np

from lindy_research.bench.table import Figure
from services.camera.io.feed import Feed, Shot
from services.marine import time_stripe

if TYPE_CHECKING:
    from tests.services.camera.test_foreign_cameras import Watched

SECONDS = 15.0  # [s] of each
UNTOLD_MS = 100.0  # [ms] goal of what is never told: the camera's coding and the quickest way


def figures() -> Iterator[Figure]:
    from tests.services.camera.test_foreign_cameras import Starved, has_gstreamer

    if shutil.which("ffmpeg") is None:
        yield Figure(section="camera", name="foreign cameras", unit="", note="no ffmpeg program")
        return
    sources = ["rtp", "udp", *(["rtsp"] if has_gstreamer() else [])]
    for name in sources:
        for feed, how in ((Feed, ""), (Starved, ", starved")):
            shots = _seen(name, feed)
            ages = [(shot.captured_ns - made) / 1e6 for shot, made in shots]
            untold = [(shot.light.at_ns - made) / 1e6 for shot, made in shots]
            exact = sum(shot.light.exact for shot, _ in shots) / max(1, len(shots))
            yield Figure(
                section="camera", name=f"{name}{how}, true age less shown, at worst", unit="ms",
                ours=max(untold, default=float("inf")),
                baseline_name="goal", baseline=UNTOLD_MS, goal=1.0,
                note=f"{len(shots)} pictures, {exact:.0%} exact; true age p50, worst "
                f"{_p(ages, 50):.0f}, {_p(ages, 100):.0f} ms",
            )  # fmt: skip


def _p(values: list[float], percent: float) -> float:
    return float(np.percentile(values, percent)) if values else float("inf")


def _seen(name: str, feed: type[Feed]) -> list[tuple[Shot, int]]:
    """Pictures, and when each was made [ns], after the first second."""
    with (
        TemporaryDirectory(prefix="lindy-bench-") as folder,
        _watched(name, feed, Path(folder)) as seen,
    ):
        seen.until_pictures(1)
        began = time.monotonic()
        seen.until(lambda: time.monotonic() > began + 1.0)
        seen.shots.clear()
        seen.until(lambda: time.monotonic() > began + 1.0 + SECONDS)
    made = [(shot, time_stripe.read(shot.picture.y, shot.arrived_ns)) for shot in seen.shots]
    return [(shot, at) for shot, at in made if at is not None]


@contextmanager
def _watched(name: str, feed: type[Feed], folder: Path) -> "Generator[Watched]":
    """A feed of a camera that films."""
    from tests.services.camera.test_foreign_cameras import SDP, free_port, sent, served, watched

    if name == "rtsp":
        with served() as (_, port), watched(f"rtsp://127.0.0.1:{port}/stream", feed) as seen:
            yield seen
        return
    port = free_port()
    source, words = f"udp://127.0.0.1:{port}", ("-f", "mpegts")
    address = f"{source}?pkt_size=1316"
    if name == "rtp":
        file = folder / "camera.sdp"
        file.write_text(SDP.format(port=port, codec="H264"))
        source, words, address = str(file), ("-f", "rtp"), f"rtp://127.0.0.1:{port}"
    with watched(source, feed) as seen, sent(*words, address):
        yield seen
