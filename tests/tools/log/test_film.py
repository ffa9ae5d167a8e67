"""The film of a dive: every picture at the time of its light, and nothing overwritten."""

import errno
import json
import os
import re
import shutil
import subprocess
from collections.abc import Iterator
from itertools import pairwise
from pathlib import Path
from typing import Any, cast

import pytest

pytest.importorskip("av")

import av
from hypothesis import given
from hypothesis import strategies as st

from messages import topics
from messages.topic import AnyTopic
from messages.video import FilmKind, FilmRequest
from services.runtime.config.errors import LindyError
from tools.log.film import (
    STEP_NS,
    TICKS,
    FilmedPicture,
    FilmPlace,
    Subtitles,
    filmed,
    filmed_spans,
    marks,
    pictures,
    within,
)
from tools.recordings.mcap_records import ALWAYS, Span, Wants, always
from tools.recordings.recording import Raw, RecordedMessage, Recording, open_recording

ffprobe = pytest.mark.skipif(shutil.which("ffprobe") is None, reason="no ffprobe program")


def probed(path: Path, *words: str) -> dict[str, Any]:
    asked = ("ffprobe", "-v", "error", "-of", "json", *words, str(path))
    answer = subprocess.run(asked, capture_output=True, check=True, text=True)
    assert answer.stderr == ""
    return json.loads(answer.stdout)


@pytest.mark.slow
@ffprobe
def test_every_picture_is_in_the_film_at_the_time_of_its_light(
    filmed_dive: Path, filmed_pictures: list[FilmedPicture], tmp_path: Path
) -> None:
    out = tmp_path / "dive.mp4"
    filmed(open_recording(filmed_dive), out)
    found = probed(out, "-count_frames", "-show_streams", "-show_packets")
    (stream,) = found["streams"]
    assert (stream["codec_name"], stream["codec_tag_string"]) == ("h264", "avc1")
    assert (stream["width"], stream["height"]) == filmed_pictures[0].size
    assert int(stream["nb_read_frames"]) == len(filmed_pictures) > 100
    began = filmed_pictures[0].light_ns
    for packet, picture in zip(found["packets"], filmed_pictures, strict=True):
        assert float(packet["pts_time"]) == pytest.approx(
            (picture.light_ns - began) / 1e9, abs=2.0 / TICKS
        )
        assert ("K" in packet["flags"]) == picture.keyframe
    with av.open(str(out)) as opened:  # not one of them is coded anew, nor damaged
        assert sum(1 for _ in opened.decode(video=0)) == len(filmed_pictures)


def test_subtitles_say_where_the_drone_was(
    filmed_dive: Path, filmed_pictures: list[FilmedPicture], tmp_path: Path
) -> None:
    out = tmp_path / "dive.mp4"
    filmed(open_recording(filmed_dive), out)
    text = out.with_suffix(".srt").read_text()
    lines = [block.split("\n")[2] for block in text.strip().split("\n\n")]
    said = {picture.drone.words for picture in filmed_pictures}
    assert set(lines) <= said
    assert re.search(r"water (7\.9|8\.[01]) °C", lines[-1])  # of the depth sensor
    assert len(lines) >= filmed_pictures[-1].light_ns // 10**9 - 1
    assert any(
        f"depth {picture.drone.depth or 0:.1f} m" in lines[-1] for picture in filmed_pictures
    )


@pytest.mark.parametrize("name", ["dive.mp4", "dive.srt"])
def test_nothing_is_overwritten(filmed_dive: Path, tmp_path: Path, name: str) -> None:
    (tmp_path / name).write_text("mine")
    with pytest.raises(LindyError, match="it exists already"):
        filmed(open_recording(filmed_dive), tmp_path / "dive.mp4")
    assert [path.name for path in tmp_path.iterdir()] == [name]
    assert (tmp_path / name).read_text() == "mine"


def test_a_full_disk_is_one_sentence_and_leaves_nothing(
    filmed_dive: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    class Full:
        """The file of a disk with room for 100 kB."""

        def __init__(self, file: Any) -> None:
            self._file = file

        def __enter__(self) -> Any:
            return self

        def __exit__(self, *_: object) -> None:
            self._file.close()

        def write(self, data: bytes) -> int:
            if self._file.tell() + len(data) > 100_000:
                raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))
            return self._file.write(data)

        def __getattr__(self, name: str) -> Any:
            return getattr(self._file, name)

    opened: Any = Path.open

    def on_a_full_disk(path: Path, *words: Any, **more: Any) -> Any:
        file = opened(path, *words, **more)
        return Full(file) if path.suffix == ".mp4" else file

    monkeypatch.setattr(Path, "open", on_a_full_disk)
    with pytest.raises(LindyError, match="the disk is full"):
        filmed(open_recording(filmed_dive), tmp_path / "dive.mp4")
    assert list(tmp_path.iterdir()) == []


def test_a_recording_without_pictures_is_one_sentence(tmp_path: Path, clean_dive: Any) -> None:
    with pytest.raises(LindyError, match="holds no pictures"):
        filmed(open_recording(clean_dive.folder), tmp_path / "dive.mp4")
    assert list(tmp_path.iterdir()) == []


@given(
    st.lists(st.booleans(), min_size=1, max_size=60),
    st.lists(st.integers(0, 70), max_size=8),
)
def test_a_marked_film_has_all_of_its_span_and_begins_with_a_keyframe(
    keyframes: list[bool], marks: list[int]
) -> None:
    keyframes[0] = True
    found = [
        FilmedPicture(10 * k, (64, 64), key, b"", FilmPlace(10 * k))
        for k, key in enumerate(keyframes)
    ]
    ordered = sorted(set(marks))
    spans = [(10 * a, 10.0 * b) for a, b in zip(ordered[::2], ordered[1::2], strict=False)]
    films = dict[int, list[FilmedPicture]]()
    for number, picture in within(found, spans):
        films.setdefault(number, []).append(picture)
    for number, (begin, end) in enumerate(spans):
        film = films.get(number, [])
        wanted = [each for each in found if begin <= each.light_ns <= end]
        assert [each for each in film if each.light_ns >= begin] == wanted
        assert not film or film[0].keyframe
        assert all(not each.keyframe for each in film[1:] if each.light_ns < begin)


@given(
    st.lists(st.tuples(st.integers(1, 3 * STEP_NS), st.sampled_from("ab")), min_size=1, max_size=50)
)
def test_a_line_is_shown_until_the_next_and_never_twice_in_a_row(
    steps: list[tuple[int, str]],
) -> None:
    subtitles, now = Subtitles(), 0
    for later, line in steps:
        subtitles.add(now, line)
        now += later
    blocks = subtitles.text().strip().split("\n\n")
    lines = [block.split("\n") for block in blocks]
    assert [int(number) for number, _, _ in lines] == list(range(1, len(lines) + 1))
    times = [span.split(" --> ") for _, span, _ in lines]
    assert all(end == begin for (_, end), (begin, _) in pairwise(times))
    said = [text for _, _, text in lines]
    assert all(a != b for a, b in pairwise(said))
    assert times[0][0] == "00:00:00,000"


def test_pictures_that_cannot_be_decoded_are_said(filmed_dive: Path) -> None:
    """Those after a part that is missing, up to the next keyframe."""
    whole, left_out = open_recording(filmed_dive), set[int]()
    every = list(pictures(whole, left_out))
    assert not left_out

    class Holed(Recording):
        """Without one message of the video."""

        def raw(self, wants: Wants = always, within: Span = ALWAYS) -> Iterator[Raw]:
            video = 0
            for raw in super().raw(wants, within):
                video += raw.key == topics.VIDEO.key
                if raw.key != topics.VIDEO.key or video != 3:
                    yield raw

    left = list(pictures(Holed(whole.files), left_out))
    assert left_out
    assert len(left) + len(left_out) in (len(every), len(every) - 1)


def test_what_was_filmed_is_of_the_camera_that_was_large_when_it_began() -> None:
    """An older recording does not say which: it had one."""
    said: list[tuple[FilmKind, str]] = [
        ("begin", "down"), ("snapshot", "front"), ("end", "front"), ("begin", ""), ("end", ""),
    ]  # fmt: skip
    requests = [
        FilmRequest(stamp_ns=10 * k, id=str(k), kind=kind, light_ns=10 * k - 4, camera=camera)
        for k, (kind, camera) in enumerate(said)
    ]

    class Marked:
        """A recording of nothing but marks."""

        def of(self, topic: AnyTopic) -> Iterator[RecordedMessage]:
            for request in requests:
                yield RecordedMessage(topic.key, request, 0, request.stamp_ns)

    recording = cast(Recording, Marked())
    assert filmed_spans(recording, "down") == [(-4, 16.0)]
    assert filmed_spans(recording, "front") == [(26, 36.0)]
    snapshots = {
        name: [light for kind, light in marks(recording, name) if kind == "snapshot"]
        for name in ("front", "down")
    }
    assert snapshots == {"front": [6], "down": []}
