"""The recording of a dive with a picture, read by readers that are not ours: the mcap library and
rerun's own, and every picture decoded by FFmpeg. Each has its time in it."""

import json
import warnings
from base64 import b64decode
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from mcap.reader import make_reader

from messages import topics
from services.marine import time_stripe
from tests.support.once import once
from tools.__main__ import main
from tools.recordings.recording import open_recording

av = pytest.importorskip("av")
chunk = pytest.importorskip("rerun.chunk", reason="the viewer extra is not installed")

S = 1_000_000_000
Recorded = list[tuple[int, bytes]]  # [ns] time, access unit


@pytest.fixture(scope="module")
def dive(tmp_path_factory: pytest.TempPathFactory, worker_id: str) -> Path:
    def fly(folder: Path) -> None:
        words = ["simulate", "--stack", "camera", "--seconds", "2", "--out", str(folder / "dive")]
        sets = ["simulator.floor_depth=8", "estimation.calibration.still_time=3", "camera.rate=12"]
        assert main([*words, *(word for each in sets for word in ("--set", each))]) == 0

    return once(tmp_path_factory, worker_id, "camera", fly) / "dive"


@pytest.fixture(scope="module")
def sent(dive: Path) -> list[int]:
    """[ns] When the light of each picture came that was sent."""
    return list(dict.fromkeys(stamps(dive, topics.VIDEO.key)))


def stamps(dive: Path, key: str) -> Iterator[int]:
    """[ns] Of all messages of a key."""
    recording = open_recording(dive)
    for raw in recording.raw():
        if raw.key == key and (message := recording.decode(raw)) is not None:
            yield message.stamp_ns


def in_the_mcap(dive: Path) -> Recorded:
    with (dive / "dive.mcap").open("rb") as stream:
        found = [
            json.loads(message.data)
            for _, _, message in make_reader(stream).iter_messages(topics=["foxglove/camera"])
        ]
    assert {row["format"] for row in found} == {"h264"}
    times = [row["timestamp"]["sec"] * S + row["timestamp"]["nsec"] for row in found]
    return [(at, b64decode(row["data"])) for at, row in zip(times, found, strict=True)]


def in_the_rrd(dive: Path) -> Recorded:
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # of a file that is written as the dive goes on
        reader = chunk.RrdReader(str(dive / "dive.rrd"))
    batches = [
        part.to_record_batch()
        for part in reader.stream().filter(content="/camera", is_static=False)
    ]
    return [
        (int(at), bytes(sample[0]))
        for batch in batches
        for at, sample in zip(
            np.asarray(batch["dive"]).astype(np.int64),
            batch["VideoStream:sample"].to_pylist(),
            strict=True,
        )
    ]


def decoded(recorded: Recorded) -> Iterator[Any]:
    decoder = av.CodecContext.create("h264", "r")
    for _, data in recorded:
        yield from decoder.decode(av.Packet(data))


@pytest.mark.parametrize("read", [in_the_mcap, in_the_rrd])
def test_every_picture_is_there_once_at_its_time(dive: Path, sent: list[int], read: Any) -> None:
    recorded: Recorded = read(dive)
    times = [at for at, _ in recorded]
    began = sent[0] - times[0]  # the viewer counts from the first message
    assert [at + began for at in times] == sent
    assert len(sent) > 30
    shown = 0
    for frame, stamp in zip(decoded(recorded), sent, strict=True):
        assert (frame.width, frame.height) == (640, 360)
        luma = frame.to_ndarray()[: frame.height]
        assert time_stripe.read(luma, stamp) == stamp // 1000 * 1000
        shown += 1
    assert shown == len(sent)


def test_the_picture_is_in_time_with_everything_else(dive: Path, sent: list[int]) -> None:
    """Each picture is of an instant of which the simulator's truth was recorded."""
    assert set(sent) <= set(stamps(dive, topics.TRUTH.key))
