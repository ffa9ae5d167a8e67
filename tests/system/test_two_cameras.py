"""Two simulated cameras over an emulated tether on virtual time: how they share it, what the
pilot's choice changes, and that both are recorded and filmed."""

import json
import shutil
import subprocess
from collections.abc import Callable
from pathlib import Path
from typing import Any

import msgspec
import numpy as np
import pytest

pytest.importorskip("av")

import av

from messages import cameras, topics
from messages.link import LinkRequest
from messages.topic import Topic
from messages.video import CameraChoice, VideoPart
from services.marine import time_stripe
from services.runtime.config.stack import Stack
from services.runtime.hosts.registry import Registry
from services.runtime.hosts.virtual_host import VirtualHost
from tools.choices import Choices
from tools.live.cockpit import with_further_cameras
from tools.log.film import filmed, filmed_cameras, pictures
from tools.log.snapshots import taken
from tools.recordings.recording import open_recording
from tools.report.report import Extras, encode, make_report
from tools.report.summary import summary
from tools.simulate import simulated

pytestmark = pytest.mark.slow

S = 1_000_000_000
SETTINGS = ("simulator.floor_depth=4", "camera.more.down.tilt=-1.5", "camera.more.down.rate=12")
LEFT_OUT = ("recorder", "visualizer", "gamepad", "predictor")
ROOM_KBIT = 384.0  # [kbit/s] of the link
CHOSEN, NARROW, END = 8 * S, 14 * S, 24 * S  # [ns]
NARROW_KBIT = 130.0  # [kbit/s] of the link: telemetry's floors leave next to nothing
ffprobe = pytest.mark.skipif(shutil.which("ffprobe") is None, reason="no ffprobe program")


class Flown:
    """Two cameras over the link `congested`, and who listens to them. The other camera is chosen;
    then the link gets narrow."""

    def __init__(self) -> None:
        stack = Stack(seed=1, virtual=True, link="congested", overrides=list(SETTINGS))
        services = with_further_cameras(Registry.read("camera"), Choices(set_=SETTINGS))
        self.host = VirtualHost()
        specs = {name: spec for name, spec in services.items() if name not in LEFT_OUT}
        self.host.add_all(services.only(specs), stack)
        names = ("front", "down")
        self.sent = {n: self._heard("drone", cameras.video(n)) for n in names}
        self.arrived = {n: self._heard("topside", cameras.video(n)) for n in names}
        self.ages = {n: self._heard("topside", cameras.age(n)) for n in names}
        self.shares = {n: self._heard("topside", topics.CAMERA_SHARES.of(n)) for n in names}
        self.log = self._heard("drone", topics.LOG.of("camera"))
        self.host.run(CHOSEN)
        self._say(topics.CAMERA_CHOICE, CameraChoice(stamp_ns=CHOSEN, camera="down"))
        self.host.run(NARROW)
        settings = (f"up.rate_kbit={NARROW_KBIT}",)
        change = LinkRequest(stamp_ns=NARROW, id="narrow", kind="set", settings=settings)
        self._say(topics.LINK_REQUEST, change)
        self.host.run(END)

    def _say(self, topic: Topic[Any], message: Any) -> None:
        self.host.side("topside").say(topic)(msgspec.msgpack.encode(message))

    def _heard(self, side: str, topic: Topic[Any]) -> list[tuple[int, Any]]:
        into: list[tuple[int, Any]] = []
        decode: Callable[[bytes], Any] = msgspec.msgpack.Decoder(topic.message).decode
        self.host.side(side).hear(
            topic.key, lambda e: into.append((self.host.now, decode(e.payload)))
        )
        return into


@pytest.fixture(scope="module")
def flown() -> Flown:
    return Flown()


def kbit(parts: list[tuple[int, VideoPart]], begin: int, end: int) -> float:
    """[kbit/s]"""
    return sum(len(part.data) for at, part in parts if begin <= at < end) * 8e6 / (end - begin)


def test_the_large_picture_keeps_its_part_and_the_small_one_is_there(flown: Flown) -> None:
    begin, end = 3 * S, CHOSEN
    front, down = (kbit(flown.arrived[name], begin, end) for name in ("front", "down"))
    assert front > 4.0 * down
    assert front > 100.0
    assert front + down < 0.85 * ROOM_KBIT
    assert sum(begin < at < end for at, _ in flown.arrived["down"]) >= 3  # slides


def test_the_pilots_choice_turns_it_round_within_a_second(flown: Flown) -> None:
    begin, end = CHOSEN + S, NARROW
    front, down = (kbit(flown.arrived[name], begin, end) for name in ("front", "down"))
    assert down > 4.0 * front > 0.0
    assert down > 80.0
    assert {said.large for _, said in flown.shares["front"]} == {"front"}
    assert max(at for at, _ in flown.shares["front"]) < CHOSEN + S
    assert {said.large for _, said in flown.shares["down"]} == {"down"}


def test_where_there_is_no_room_the_small_one_stops_first_and_says_so(flown: Flown) -> None:
    begin = NARROW + 6 * S
    assert not [at for at, _ in flown.sent["front"] if at > begin]
    assert kbit(flown.arrived["down"], begin, END) > 15.0
    said = [line.text for at, line in flown.log if at > NARROW and "no room" in line.text]
    assert said == ["the link has no room for a small camera's picture: front camera"]
    words = {age.words for at, age in flown.ages["front"] if at > begin}
    assert words == {"front camera: the link has no room for its picture"}
    assert not any("front" in age.words for _, age in flown.ages["down"])


def test_a_slide_show_is_no_alarm(flown: Flown) -> None:
    """A small picture may be older than a large one before it is said to be old."""
    small = [age for at, age in flown.ages["down"] if 4 * S < at < CHOSEN]
    assert max(age.age_ms for age in small) > 500.0
    assert {age.words for age in small} == {""}


@pytest.fixture(scope="module")
def dive(tmp_path_factory: pytest.TempPathFactory) -> Path:
    out = tmp_path_factory.mktemp("cameras") / "dive"
    choices = Choices(
        stack="camera", link="wifi_buoy", seconds=4.0, out=out,
        set_=(*SETTINGS, "estimation.calibration.still_time=1"),
    )  # fmt: skip
    simulated(choices)
    return out


def test_the_report_says_how_old_the_picture_of_each_is(dive: Path) -> None:
    report = make_report(open_recording(dive), Extras())
    assert report.picture
    assert report.picture.per_second > 3.0
    assert report.further_pictures
    (down,) = report.further_pictures.values()
    assert list(report.further_pictures) == ["down"]
    assert 0.0 < down.per_second <= 12.5
    assert b'"further_pictures":{"down":' in encode(report).replace(b" ", b"").replace(b"\n", b"")
    rows = [row for row in summary(report).splitlines() if row.startswith("light to picture")]
    assert [row.split()[3] for row in rows] == ["front:", "down:"]


@ffprobe
def test_both_are_recorded_and_each_has_a_film(dive: Path, tmp_path: Path) -> None:
    recording = open_recording(dive)
    assert filmed_cameras(recording) == ["front", "down"]
    filmed(recording, tmp_path / "dive.mp4", camera="all")
    assert sorted(path.name for path in tmp_path.glob("*.mp4")) == [
        "dive-down.mp4",
        "dive-front.mp4",
    ]
    for name in ("front", "down"):
        asked = ("ffprobe", "-v", "error", "-of", "json", "-count_frames", "-show_streams")
        path = tmp_path / f"dive-{name}.mp4"
        answer = subprocess.run([*asked, str(path)], capture_output=True, check=True, text=True)
        assert answer.stderr == ""
        (stream,) = json.loads(answer.stdout)["streams"]
        assert int(stream["nb_read_frames"]) == len(list(pictures(recording, camera=name))) > 30
    filmed(recording, tmp_path / "dive.mp4")  # of the large one
    films = [(tmp_path / name).read_bytes() for name in ("dive.mp4", "dive-front.mp4")]
    assert films[0] == films[1]


def test_each_picture_is_of_its_camera_at_its_time(dive: Path) -> None:
    """By the time in it; and the camera that looks down sees the floor alone, which is darker than
    the water far ahead."""
    recording, seen = open_recording(dive), dict[str, float]()
    for name in ("front", "down"):
        decoder, bright = av.CodecContext.create("h264", "r"), list[float]()
        light = [message.stamp_ns for message in messages(dive, cameras.video(name).key)]
        stamps = iter(dict.fromkeys(light))
        for picture in pictures(recording, camera=name):
            (frame,) = decoder.decode(av.Packet(picture.data))
            luma = np.asarray(frame.to_ndarray()[: frame.height], np.uint8)
            stamp = next(stamps)
            assert time_stripe.read(luma, stamp) == stamp // 1000 * 1000
            bright.append(float(np.mean(luma[40:])))
        seen[name] = float(np.median(bright))
    assert seen["down"] < seen["front"] - 10.0


def messages(dive: Path, key: str) -> list[Any]:
    recording = open_recording(dive)
    return [recording.decode(raw) for raw in recording.raw() if raw.key == key]


def test_a_snapshot_of_each_camera_says_which(dive: Path, tmp_path: Path) -> None:
    pytest.importorskip("PIL")
    written = taken(open_recording(dive), tmp_path, at=(2.0,), camera="all")
    assert [path.stem.rpartition("-")[2] for path in written] == ["front", "down"]
