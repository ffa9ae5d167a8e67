"""A dive with a camera that others wrote: GStreamer's RTSP server, which vanishes and returns."""

import json
import time
from pathlib import Path

import pytest

pytest.importorskip("av")

from tests.services.camera.test_foreign_cameras import gstreamer, served
from tests.support.started import Started

pytestmark = [pytest.mark.system, pytest.mark.slow]
SEEN_S = 6.0  # [s] of pictures, before and after


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
