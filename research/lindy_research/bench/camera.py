"""What the camera costs, how old its picture is topside, and that it holds nothing else up.

Costs are processor times of one thread. The age is from dives with real processes: from the
simulator's truth, which is the light, to the whole picture, as `link_monitor` measures it. What
crosses the link beside the picture is measured on virtual time, the same dive with and without a
camera.
"""

import time
from collections.abc import Callable, Iterable, Iterator
from functools import partial
from importlib.util import find_spec
from math import radians
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import msgspec
import numpy as np

from lindy.api import LindyError
from lindy.api.dives import Registry, Stack, VirtualHost
from lindy.api.messages import topics
from lindy_research.bench.costs import Cost, costs
from lindy_research.bench.real_dive import HAS_STICKS, PILOT, started
from lindy_research.bench.table import Figure
from services.runtime.bus.envelope import Envelope
from tools.analysis.latency import PictureReport

S = 1_000_000_000  # [ns]
SIZES = ((640, 360), (1280, 720))
HZ = 25.0  # [1/s]
SHARE = 0.1  # [-] of a core, goal of the simulated picture at 640 × 360
PICTURES = 75
LINKS_WITH_PICTURE = ("tether", "wifi_buoy", "congested", "severe")
SECONDS, SETTLED = 40.0, 10.0  # [s] of a virtual dive, and from when on it is measured
NOT_SLOWER = 1.2  # [-] goal of the p99 with a picture
DIVES = ("perfect", "tether", "wifi_buoy")
DIVE_S = 20.0  # [s] armed
PROCESSES = ("camera", "link_monitor")
FILES = ("recorder", "visualizer")
FLOOR = "simulator.floor_depth=8"  # [m] so that there is something to be seen


def figures() -> list[Figure]:
    if find_spec("av") is None:
        return [Figure(section="camera", name="picture", unit="", note="no PyAV")]
    return [*_costs(), *_beside(), *_ages()]


def _figure(name: str, unit: str, ours: float | None, **more: Any) -> Figure:
    return Figure(section="camera", name=name, unit=unit, ours=ours, **more)


def _costs() -> Iterator[Figure]:
    from lindy.api.vehicle import from_euler
    from services.camera.core import Order
    from services.camera.io.encoder import VideoEncoder
    from services.camera.sea import CameraView, SimulatedSea, WaterLight

    for width, height in SIZES:
        sea = SimulatedSea(width, height, radians(80.0), WaterLight(), 8.0)
        views = [
            CameraView((0.5 + 0.01 * k, 0.3, 6.0), from_euler(0.02, -0.05, 0.01 * k), -0.1, 0.5)
            for k in range(PICTURES)
        ]
        drawn, pictures = _timed(sea.draw, views)
        size = f"{width} × {height}"
        goal = {"baseline_name": f"a tenth of a core at {HZ:g} Hz", "baseline": SHARE / HZ * 1e3}
        yield _figure(
            f"draw, {size}", "ms", drawn, note=_share(drawn),
            **({**goal, "goal": 1.0} if width == SIZES[0][0] else {}),
        )  # fmt: skip
        encoder = VideoEncoder(width, height)
        orders = [Order(1500.0, HZ, k == 0) for k in range(PICTURES)]
        encoded, _ = _timed(
            partial(_encode, encoder), list(zip(pictures, orders, range(PICTURES), strict=True))
        )
        yield _figure(f"encode, {size}", "ms", encoded, note=_share(encoded))


def _share(ms: float) -> str:
    return f"{100.0 * ms * 1e-3 * HZ:.1f} % of a core at {HZ:g} Hz"


def _encode(encoder: Any, what: tuple[Any, Any, int]) -> bytes:
    picture, order, number = what
    return encoder.encode(picture, round(number * S / HZ), order)


def _timed(call: Callable[[Any], Any], inputs: Iterable[Any]) -> tuple[float, list[Any]]:
    """[ms] Median processor time of one call, and what the calls gave."""
    times, results = list[float](), list[Any]()
    for each in inputs:
        began = time.process_time()
        results.append(call(each))
        times.append(time.process_time() - began)
    return float(np.median(times)) * 1e3, results


def _beside() -> Iterator[Figure]:
    """The p99 on the link of what the pilot flies by."""
    for link in LINKS_WITH_PICTURE:
        off, on = _crossing(link, camera=False), _crossing(link, camera=True)
        for key in (topics.PILOT_COMMAND.key, topics.STATE.key):
            yield _figure(
                f"{link}, {key} p99 with a picture", "ms", _p99(on[key]),
                baseline_name="without", baseline=_p99(off[key]), goal=NOT_SLOWER,
                note=f"{len(on[key])} arrive, {len(off[key])} without",
            )  # fmt: skip
        pictures = len(on[topics.VIDEO.key]) / (SECONDS - SETTLED)
        yield _figure(
            f"{link}, pictures", "1/s", pictures,
            note=f"{on['kbit'][0]:.0f} kbit/s" if on["kbit"] else "",
        )  # fmt: skip


def _crossing(link: str, *, camera: bool) -> dict[str, list[float]]:
    """[ms] Delays of a virtual dive by key; of the pictures those of their last parts."""
    services = Registry.read("camera" if camera else "simulated")
    kept = {name: spec for name, spec in services.items() if name not in FILES}
    stack = Stack(
        link=link, pilot="script:first_dive", seed=1, virtual=True, overrides=[FLOOR]
    )  # fmt: skip
    host = VirtualHost()
    host.add_all(services.only(kept), stack)
    delays: dict[str, list[float]] = {"kbit": []}
    carried = 0

    def listen(topic: Any, side: str) -> None:
        decode = msgspec.msgpack.Decoder(topic.message).decode
        kept = delays.setdefault(topic.key, [])

        def hear(envelope: Envelope) -> None:
            nonlocal carried
            try:
                message = decode(envelope.payload)
            except msgspec.MsgspecError:  # damaged on the link
                return
            if host.now < SETTLED * S:
                return
            if topic is topics.VIDEO:
                carried += len(message.data)
                if message.part < message.parts - 1:
                    return
            kept.append((host.now - message.stamp_ns) / 1e6)

        host.side(side).hear(topic.key, hear)

    listen(topics.PILOT_COMMAND, "drone")
    listen(topics.STATE, "topside")
    listen(topics.VIDEO, "topside")
    host.run(round(SECONDS * S))
    if carried:
        delays["kbit"].append(carried * 8e-3 / (SECONDS - SETTLED))
    return delays


def _p99(values: list[float]) -> float:
    return float(np.percentile(values, 99)) if values else float("inf")


def _ages() -> Iterator[Figure]:
    """Light to picture in dives with processes; the goal is the encoder, the link and one
    picture's time. And what these processes cost."""
    for link in DIVES:
        with TemporaryDirectory(prefix="lindy-bench-") as folder:
            found, spent = _flown(Path(folder), link)
        stages = {name: ms or 0.0 for name, ms in found.stages_ms.items()}
        parts = ", ".join(f"{name} {ms:.1f}" for name, ms in stages.items())
        least = sum(stages.get(name, 0.0) for name in ("encoded", "crossed")) + 1e3 / HZ
        for name, ms in (("p50", found.p50_ms), ("p99", found.p99_ms)):
            yield _figure(
                f"{link}, light to picture {name}", "ms", ms,
                baseline_name="encode, link, one picture", baseline=least,
                goal=1.0 if name == "p50" else None,
                note=f"{parts}; {found.per_second:.1f} a second",
            )  # fmt: skip
        for name in PROCESSES:
            yield _figure(
                f"{link}, process {name}", "% of a core", spent[name].cpu,
                note=f"{spent[name].rss_mb:.0f} MB",
            )  # fmt: skip


def _flown(folder: Path, link: str) -> tuple[PictureReport, dict[str, Cost]]:
    """The report's figures of a dive's picture, and what its processes cost."""
    words = ("dive", "--stack", "camera", "--headless", "--link", link, "--set", FLOOR)
    with started(folder / "dive", *words, *PILOT) as dive:
        dive.until_said(HAS_STICKS)
        pids = dive.pids()
        spent = costs({name: pids[name] for name in PROCESSES}, DIVE_S)
        report = dive.report()
    if report.picture is msgspec.UNSET or not spent.keys() >= set(PROCESSES):
        raise LindyError(f"no picture was measured in the benchmark's dive on {link}")
    return report.picture, spent
