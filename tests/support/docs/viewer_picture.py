"""The viewer without a window, for pictures of the docs and for tests that look at it. It needs
Vulkan, in software at least; on Debian: mesa-vulkan-drivers and libvulkan1."""

import contextlib
import os
import subprocess
import time
from collections.abc import Generator
from contextlib import contextmanager
from importlib.util import find_spec
from pathlib import Path

import pytest
from rerun.experimental import ViewerClient

from tests.support.doors import free_port
from tests.support.patience import until

SIZE = "1600x900"  # [px]
TIMELINE = "dive"
DRAW_S = 1.0  # for the panels to settle after the time is set
DRIVERS = [Path("/usr/share/vulkan/icd.d"), Path("/etc/vulkan/icd.d")]
needs_vulkan = pytest.mark.skipif(
    not [file for folder in DRIVERS if folder.is_dir() for file in folder.glob("*.json")],
    reason="no Vulkan driver here: install mesa-vulkan-drivers and libvulkan1",
)


def picture(rrd: Path, at_s: float, page: str | None = None) -> bytes:
    """The viewer at a time [s] of the dive, as a PNG. `page` None: the one that is shown first."""
    with viewer(rrd) as client:
        loaded(client)
        if page is not None:
            _turn_to(client, page)
        return shot(client, at_s, DRAW_S)


def shot(client: ViewerClient, at_s: float, settle_s: float) -> bytes:
    """The viewer with its time cursor at `at_s` [s], as a PNG."""
    client.set_time(TIMELINE, duration=at_s, play_state="paused")
    time.sleep(settle_s)
    client.take_screenshot()  # the first one may show panels that are still being drawn
    return client.take_screenshot()


def _turn_to(client: ViewerClient, page: str) -> None:
    """Bring a page to the front."""
    layout = client.get_blueprint().blueprint
    root = layout["/viewport"]["ViewportBlueprint"]["root_container"]
    tabs = layout.get(f"/container/{root}", {}).get("ContainerBlueprint", {})
    for one in tabs.get("contents", []):
        named = layout.get(f"/{one}", {}).get("ContainerBlueprint", {}).get("display_name", "")
        if named.lower() == page:
            tabs["active_tab"] = one
            client.set_blueprint(layout, of="recording")
            return
    raise AssertionError(f"there is no page {page}")


@contextmanager
def viewer(rrd: Path) -> Generator[ViewerClient]:
    """A viewer that has been told to open the recording."""
    spec = find_spec("rerun_cli")
    assert spec is not None
    assert spec.origin is not None
    program = Path(spec.origin).parent / ("rerun.exe" if os.name == "nt" else "rerun")
    port = free_port()
    command = [str(program), "--headless", "--bind", "127.0.0.1", "--port", str(port)]
    command += ["--window-size", SIZE, "--hide-welcome-screen", str(rrd)]
    process = subprocess.Popen(
        command, stdin=subprocess.DEVNULL, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL
    )

    def connected() -> ViewerClient | None:
        assert process.poll() is None, "the viewer died; without Vulkan it does at once"
        with contextlib.suppress(Exception):  # nobody listens yet
            return ViewerClient.connect(f"rerun+http://127.0.0.1:{port}/proxy")
        return None

    try:
        yield until(connected)
    finally:
        process.kill()
        process.wait()


def loaded(client: ViewerClient) -> tuple[float, float]:
    """First and last time [s] of the dive, once all of it is there."""

    def span() -> tuple[float, float] | None:
        state = client.get_state()
        if state.loading or not state.views:
            return None
        for recording in state.recordings:
            for line in recording.timelines:
                if line.name == TIMELINE and line.start is not None and line.end is not None:
                    return line.start / 1e9, line.end / 1e9
        return None

    return until(span)
