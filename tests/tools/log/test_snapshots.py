"""Snapshots: the picture that was seen, with where it was taken in its EXIF fields."""

from pathlib import Path

import pytest

pytest.importorskip("av")
pytest.importorskip("PIL")

import av
import numpy as np
from PIL import Image
from PIL.ExifTags import GPS, IFD, Base

from services.marine import time_stripe
from services.runtime.config.errors import LindyError
from tools.log.film import FilmedPicture
from tools.log.snapshots import TEMPERATURE, jpeg, last_of, taken
from tools.recordings.recording import open_recording


def luma_of_each(pictures: list[FilmedPicture]) -> list[np.ndarray]:
    """The luma of each, as it was sent."""
    decoder = av.CodecContext.create("h264", "r")
    every = [frame for each in pictures for frame in decoder.decode(av.Packet(each.data))]
    return [frame.to_ndarray(format="gray").astype(float) for frame in every]


@pytest.mark.slow
def test_a_snapshot_is_the_newest_picture_by_then_and_says_where(
    filmed_dive: Path, filmed_pictures: list[FilmedPicture], tmp_path: Path
) -> None:
    frames = luma_of_each(filmed_pictures)
    seconds = (1.5, 5.0, 6.02)
    written = taken(open_recording(filmed_dive), tmp_path / "pictures", seconds)
    assert len(written) == len(seconds)
    for at, path in zip(seconds, written, strict=True):
        until = filmed_pictures[0].light_ns + round(1e9 * at)
        number = len([each for each in filmed_pictures if each.light_ns <= until]) - 1
        shot = filmed_pictures[number]
        with Image.open(path) as image:
            exif = image.getexif()
            seen = np.asarray(image.convert("L"))
        assert time_stripe.read(seen, 0) is None
        away = [np.abs(frame - seen.astype(float))[time_stripe.BELOW :].mean() for frame in frames]
        assert np.argmin(away) == number  # the picture itself, by its pixels
        above, below = seen[: time_stripe.BELOW], seen[time_stripe.BELOW : 2 * time_stripe.BELOW]
        assert above.mean() == pytest.approx(below.mean(), abs=2.0)
        assert exif[Base.DateTime] == f"{shot.drone.utc:%Y:%m:%d %H:%M:%S}"
        gps = exif.get_ifd(IFD.GPSInfo)
        if shot.drone.depth is not None:
            assert float(gps[GPS.GPSAltitude]) == pytest.approx(max(0, shot.drone.depth), abs=0.01)
            assert gps[GPS.GPSAltitudeRef] == b"\x01"
        if shot.drone.heading is not None:
            assert float(gps[GPS.GPSImgDirection]) == pytest.approx(shot.drone.heading, abs=0.1)


@pytest.mark.slow
def test_place_is_in_the_comment(filmed_pictures: list[FilmedPicture]) -> None:
    import io

    first = filmed_pictures[0]
    image = last_of([first.data])
    assert image is not None
    data = jpeg(image, first.drone._replace(north=1.25, east=-3.5, water=7.25))
    exif = Image.open(io.BytesIO(data)).getexif()
    comment = exif.get_ifd(IFD.Exif)[Base.UserComment]
    assert comment == b"ASCII\0\0\0north 1.25 m, east -3.50 m"
    assert float(exif.get_ifd(IFD.Exif)[TEMPERATURE]) == pytest.approx(7.2, abs=0.06)
    assert "water 7.2 C" in exif[Base.ImageDescription]


def test_nothing_is_overwritten_and_none_is_one_sentence(filmed_dive: Path, tmp_path: Path) -> None:
    recording = open_recording(filmed_dive)
    (path,) = taken(recording, tmp_path, (3.0,))
    before = path.read_bytes()
    with pytest.raises(LindyError, match="it exists already"):
        taken(recording, tmp_path, (3.0,))
    assert path.read_bytes() == before
    with pytest.raises(LindyError, match="holds no snapshots"):
        taken(recording, tmp_path)


@pytest.mark.parametrize("at", [float("nan"), float("inf"), -1.0, 1e300])
def test_a_time_that_cannot_be_is_one_sentence(
    filmed_dive: Path, tmp_path: Path, at: float
) -> None:
    with pytest.raises(LindyError, match="expected seconds from 0 to"):
        taken(open_recording(filmed_dive), tmp_path, (at,))
    assert not list(tmp_path.iterdir())
