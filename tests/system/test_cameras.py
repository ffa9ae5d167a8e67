"""Simulated cameras over an emulated tether on virtual time: the picture's age and bitrate, who
has the link first, how two cameras share it, and that both are recorded and filmed. And a dive with
a camera that others wrote: GStreamer's RTSP server, which vanishes and returns."""

import json
import shutil
import subprocess
import time
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
from tests.services.camera.test_foreign_cameras import gstreamer, served
from tests.support.once import once
from tests.support.started import Started
from tools.choices import Choices
from tools.live.cockpit import with_further_cameras
from tools.log.film import filmed, filmed_cameras, pictures
from tools.log.snapshots import taken
from tools.recordings.recording import open_recording
from tools.report.report import Extras, encode, make_report
from tools.report.summary import summary
from tools.simulate import simulated

S = 1_000_000_000
UNHEARD = ("recorder", "visualizer")
UNFLOWN = (*UNHEARD, "gamepad", "predictor")


class CameraDive:
    """Services of a stack with cameras, and what is said in a realm, with the moment [ns]."""

    def __init__(
        self, stack: Stack, rows: Registry | None = None, left_out: tuple[str, ...] = UNFLOWN
    ) -> None:
        rows, self.host = rows or Registry.read("camera"), VirtualHost()
        self.host.add_all(
            rows.only({name: spec for name, spec in rows.items() if name not in left_out}), stack
        )

    def heard(self, side: str, topic: Topic[Any]) -> list[tuple[int, Any]]:
        """From now on."""
        into: list[tuple[int, Any]] = []
        decode: Callable[[bytes], Any] = msgspec.msgpack.Decoder(topic.message).decode
        self.host.side(side).hear(
            topic.key, lambda e: into.append((self.host.now, decode(e.payload)))
        )
        return into

    def say(self, topic: Topic[Any], message: Any) -> None:
        self.host.side("topside").say(topic)(msgspec.msgpack.encode(message))


def kbit(parts: list[tuple[int, VideoPart]], begin: int, end: int) -> float:
    """[kbit/s]"""
    return sum(len(part.data) for at, part in parts if begin <= at < end) * 8e6 / (end - begin)


# One camera over `tether`, then `congested`, then `tether` again.

WORSE, BETTER, OVER = 3 * S, 8 * S, 12 * S  # [ns] when the link changes


class OneCamera(CameraDive):
    def __init__(self) -> None:
        super().__init__(Stack(seed=1, virtual=True, overrides=["simulator.floor_depth=4"]))
        self.sent = self.heard("drone", topics.VIDEO)
        self.arrived = self.heard("topside", topics.VIDEO)
        self.ages = self.heard("topside", topics.PICTURE_AGE)
        for until, profile in ((WORSE, "congested"), (BETTER, "tether"), (OVER, "")):
            self.host.run(until)
            if profile:
                change = LinkRequest(stamp_ns=until, id=profile, kind="profile", profile=profile)
                self.say(topics.LINK_REQUEST, change)


def the_age_is_said_stage_by_stage(one: OneCamera) -> None:
    good = [age for at, age in one.ages if S < at < WORSE]
    assert all(age.exact for age in good)
    assert np.mean([age.per_second for age in good]) > 23.0
    for age in good:
        assert age.total.p50_ms == pytest.approx(sum(s.p50_ms for s in age.stages), abs=1.0)


def the_bitrate_follows_the_link_down_within_two_seconds_and_up_again(one: OneCamera) -> None:
    assert kbit(one.sent, WORSE - S, WORSE) > 150.0
    after = kbit(one.sent, WORSE + 2 * S, BETTER)
    assert 80.0 < after < 0.85 * ROOM_KBIT  # the picture goes before telemetry
    assert max(part.budget_kbit for at, part in one.sent if at > BETTER + 3 * S) > 1000.0


def what_arrives_is_never_late(one: OneCamera) -> None:
    """On any link: a part waits for 1 s at most, and takes 30 ms and its time to be sent. And no
    part is lost in silence."""
    assert max(at - part.encoded_ns for at, part in one.arrived) < 1.4 * S
    missing, on_the_way = len(one.sent) - len(one.arrived), 20
    told = one.host.nodes["tether"].counts["no_room:camera/video"]
    assert 0 <= missing - told <= on_the_way


@pytest.mark.slow
def test_age_and_bitrate_follow_the_link_and_what_is_late_is_not_shown() -> None:
    one = OneCamera()
    the_age_is_said_stage_by_stage(one)
    the_bitrate_follows_the_link_down_within_two_seconds_and_up_again(one)
    what_arrives_is_never_late(one)


# On a link with little room the picture comes first; state and commands keep their rates.

SETTLED, ENOUGH = 9 * S, 18 * S  # [ns]
SECONDS = (ENOUGH - SETTLED) / S
NEAR = 0.95  # [-] the state's rate, as it is seen


class Narrow(CameraDive):
    """A link of so many kilobits a second up."""

    def __init__(self, folder: Path, up_kbit: float) -> None:
        path = folder / "narrow.toml"
        path.write_text(f"[down]\ndelay_ms = 1.0\n[up]\ndelay_ms = 1.0\nrate_kbit = {up_kbit}\n")
        overrides = ["simulator.floor_depth=8"]
        stack = Stack(
            link=str(path), pilot="script:first_dive", seed=1, virtual=True, overrides=overrides
        )
        super().__init__(stack, left_out=UNHEARD)
        self.states = self.heard("topside", topics.STATE)
        self.video = self.heard("topside", topics.VIDEO)
        self.commands = self.heard("drone", topics.PILOT_COMMAND)
        self.host.run(ENOUGH)

    def rate(self, heard: list[tuple[int, Any]]) -> float:
        """[1/s] Once it has settled."""
        return sum(at >= SETTLED for at, _ in heard) / SECONDS


@pytest.mark.slow
@pytest.mark.parametrize(
    ("up_kbit", "picture", "state"),
    [(2000.0, 1400.0, 10.0), (600.0, 350.0, 10.0), (200.0, 65.0, 9.0)],
)
def test_the_picture_has_most_of_a_narrow_link(
    tmp_path: Path, up_kbit: float, picture: float, state: float
) -> None:
    seen = Narrow(tmp_path, up_kbit)
    assert kbit(seen.video, SETTLED, ENOUGH) >= picture
    assert seen.rate(seen.states) >= NEAR * state
    assert seen.rate(seen.commands) >= topics.PILOT_COMMAND.hz - 1.0


@pytest.mark.slow
def test_the_narrowest_link_has_a_picture_every_two_seconds(tmp_path: Path) -> None:
    seen = Narrow(tmp_path, 60.0)
    whole = [at for at, part in seen.video if part.part == part.parts - 1]
    assert whole[0] < 3 * S
    later = [at for at in whole if at >= SETTLED]
    assert all(b - a <= 2 * S for a, b in zip([SETTLED, *later], [*later, ENOUGH], strict=True))


# Two cameras over the link `congested`. The other camera is chosen; then the link gets narrow.

SETTINGS = ("simulator.floor_depth=4", "camera.more.down.tilt=-1.5", "camera.more.down.rate=12")
ROOM_KBIT = 384.0  # [kbit/s] of the link
CHOSEN, NARROW, END = 8 * S, 14 * S, 24 * S  # [ns]
NARROW_KBIT = 100.0  # [kbit/s] of the link: telemetry's floors leave next to nothing
ffprobe = pytest.mark.skipif(shutil.which("ffprobe") is None, reason="no ffprobe program")


class TwoCameras(CameraDive):
    def __init__(self) -> None:
        rows = with_further_cameras(Registry.read("camera"), Choices(set_=SETTINGS))
        super().__init__(
            Stack(seed=1, virtual=True, link="congested", overrides=list(SETTINGS)), rows
        )
        names = ("front", "down")
        self.sent = {n: self.heard("drone", cameras.video(n)) for n in names}
        self.arrived = {n: self.heard("topside", cameras.video(n)) for n in names}
        self.ages = {n: self.heard("topside", cameras.age(n)) for n in names}
        self.shares = {n: self.heard("topside", topics.CAMERA_SHARES.of(n)) for n in names}
        self.log = self.heard("drone", topics.LOG.of("camera"))
        self.host.run(CHOSEN)
        self.say(topics.CAMERA_CHOICE, CameraChoice(stamp_ns=CHOSEN, camera="down"))
        self.host.run(NARROW)
        settings = (f"up.rate_kbit={NARROW_KBIT}",)
        change = LinkRequest(stamp_ns=NARROW, id="narrow", kind="set", settings=settings)
        self.say(topics.LINK_REQUEST, change)
        self.host.run(END)


def the_large_picture_keeps_its_part_and_the_small_one_is_there(flown: TwoCameras) -> None:
    begin, end = 3 * S, CHOSEN
    front, down = (kbit(flown.arrived[name], begin, end) for name in ("front", "down"))
    assert front > 4.0 * down
    assert front > 100.0
    assert front + down < 0.85 * ROOM_KBIT
    assert sum(begin < at < end for at, _ in flown.arrived["down"]) >= 3  # slides


def the_pilots_choice_turns_it_round_within_a_second(flown: TwoCameras) -> None:
    begin, end = CHOSEN + S, NARROW
    front, down = (kbit(flown.arrived[name], begin, end) for name in ("front", "down"))
    assert down > 4.0 * front > 0.0
    assert down > 80.0
    assert {said.large for _, said in flown.shares["front"]} == {"front"}
    assert max(at for at, _ in flown.shares["front"]) < CHOSEN + S
    assert {said.large for _, said in flown.shares["down"]} == {"down"}


def where_there_is_no_room_the_small_one_stops_first(flown: TwoCameras) -> None:
    begin = NARROW + 6 * S
    assert not [at for at, _ in flown.sent["front"] if at > begin]
    assert kbit(flown.arrived["down"], begin, END) > 15.0
    assert {said.kbit["front"] for at, said in flown.shares["down"] if at > begin} == {0.0}


@pytest.mark.slow
def test_two_cameras_share_a_link_as_the_pilot_chooses() -> None:
    flown = TwoCameras()
    the_large_picture_keeps_its_part_and_the_small_one_is_there(flown)
    the_pilots_choice_turns_it_round_within_a_second(flown)
    where_there_is_no_room_the_small_one_stops_first(flown)


@pytest.fixture(scope="module")
def dive(tmp_path_factory: pytest.TempPathFactory, worker_id: str) -> Path:
    def fly(folder: Path) -> None:
        choices = Choices(
            stack="camera", link="wifi_buoy", seconds=4.0, out=folder / "dive",
            set_=(*SETTINGS, "estimation.calibration.still_time=1"),
        )  # fmt: skip
        simulated(choices)

    return once(tmp_path_factory, worker_id, "two_cameras", fly) / "dive"


@pytest.mark.slow
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


@pytest.mark.slow
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


@pytest.mark.slow
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


@pytest.mark.slow
def test_a_snapshot_of_each_camera_says_which(dive: Path, tmp_path: Path) -> None:
    pytest.importorskip("PIL")
    written = taken(open_recording(dive), tmp_path, at=(2.0,), camera="all")
    assert [path.stem.rpartition("-")[2] for path in written] == ["front", "down"]


# A camera of others.

SEEN_S = 6.0  # [s] of pictures, before and after


@pytest.mark.slow
@pytest.mark.system
@gstreamer
def test_the_dive_goes_on_and_the_picture_comes_back(tmp_path: Path) -> None:
    words = ("dive", "--stack", "camera", "--headless", "--pilot", "script:first_dive")
    with served() as (server, port):
        source = ("--set", f"camera.source=rtsp://127.0.0.1:{port}/stream")
        with Started(tmp_path / "dive", *words, *source) as dive:
            dive.until_armed()
            time.sleep(SEEN_S)  # the dive is measured, not this
            server.kill()
            dive.until_said("gives no pictures")
            with served(port):
                dive.until_said("gives pictures again")
                time.sleep(SEEN_S)
                dive.end()
    report = json.loads((dive.out / "report.json").read_text())
    assert report["exit"] == "clean"
    assert report["picture"]["per_second"] > 1.0  # the server was gone for a part of the time
    assert report["losses"]["lost:camera"] >= 1
