import sys
from collections.abc import Callable
from pathlib import Path

import msgspec
import numpy as np
import pytest

from messages import topics
from messages.message import Estimate, Message
from messages.state import VehicleState
from messages.topic import AnyTopic, Direction
from services.marine.vehicle import Vehicle
from services.runtime.config.errors import LindyError
from services.runtime.config.stack import Stack
from services.runtime.hosts.stack_file import ServiceSpec
from services.runtime.hosts.virtual_host import VirtualHost
from services.runtime.node.node import Node
from services.runtime.node.ports import Publisher
from services.visualizer.batch import Batch, CurveColumns, Note
from services.visualizer.io.live_viewer import LiveViewer, viewer_command
from services.visualizer.service import wire
from tests.support.patience import PATIENCE_S, until

chunk = pytest.importorskip("rerun.chunk", reason="the viewer extra is not installed")

from services.visualizer.io.rerun_writer import RerunWriter  # noqa: E402 - needs rerun

# Our files have no index, by choice; the reader says so.
pytestmark = pytest.mark.filterwarnings("ignore:RRD file has no footer")

Sample = Callable[[str, int], Message]
SECOND = 1_000_000_000
BOTH_REALMS = ServiceSpec(["topside", "drone"])


def speak(sides: dict[str, Node], sample: Sample) -> None:
    """Let everybody else say everything they say, five times a second."""
    publishers: list[tuple[AnyTopic, Publisher[Message]]] = []
    for topic in topics.ALL:
        node = sides["drone" if topic.way is Direction.STAY else "topside"]
        one = topic.of("control") if topic.is_family else topic
        publishers.append((topic, node.publisher(one)))

    def say(now: int) -> None:
        for topic, publisher in publishers:
            publisher.put(sample(topic.key, now))

    sides["topside"].every(5.0, say)


def dive(out: Path, sample: Sample, seconds: float, *, restart: bool = False) -> VirtualHost:
    host, stack = VirtualHost(), Stack(out=str(out))
    others = {side: host.node(side, [side]) for side in BOTH_REALMS.sides}
    host.add("visualizer", BOTH_REALMS, stack, wire)
    speak(others, sample)
    host.run(round(seconds * SECOND))
    if restart:
        killed = host.nodes["visualizer"]
        host.kill("visualizer")
        killed.close()  # so that its file does not stay open here
        host.add("visualizer", BOTH_REALMS, stack, wire)
        host.run(round(2 * seconds * SECOND))
    return host


def read_back(rrd: Path, path: str) -> tuple[list[float], list[float]]:
    """Times [s] and values of one curve."""
    stream = chunk.RrdReader(str(rrd)).stream().filter(content=path, is_static=False)
    batches = [part.to_record_batch() for part in stream]
    times = [np.asarray(b["dive"]).astype(np.int64) / 1e9 for b in batches]
    values = [np.asarray(b["Scalars:scalars"].flatten()) for b in batches]
    return np.concatenate(times).tolist(), np.concatenate(values).tolist()


def entities(rrd: Path) -> set[str]:
    return {str(c.entity_path) for c in chunk.RrdReader(str(rrd)).stream() if not c.is_static}


def test_every_stream_of_both_realms_is_in_the_file(tmp_path: Path, sample: Sample) -> None:
    host = dive(tmp_path, sample, 2.0)
    counts = host.nodes["visualizer"].counts
    host.close()
    assert not counts
    found = entities(tmp_path / "dive.rrd")
    shown = {"/sticks", "/specific_force", "/magnetic_field", "/pressure", "/power/voltage"}
    shown |= {"/depth/estimate", "/depth/reference", "/depth/truth", "/force/wanted", "/thrust"}
    shown |= {"/thrust_command", "/latency/link_up", "/health/processor/control", "/status"}
    shown |= {"/log/control", "/log/pilot", "/state/activity", "/state/link", "/world/vehicle"}
    shown |= {"/world/path", "/world/reference", "/world/vehicle/thrust"}
    assert shown <= found


def test_of_equal_samples_only_the_ends_are_written(tmp_path: Path, sample: Sample) -> None:
    """The same line is drawn. The end is drawn anew with each write of the file."""

    def stepping(key: str, now: int) -> Message:
        message = sample(key, now)
        if isinstance(message, VehicleState):
            depth = Estimate(float(now > 5 * SECOND), 0.1)
            return msgspec.structs.replace(message, depth=depth)
        return message

    dive(tmp_path, stepping, 10.1).close()
    times, values = read_back(tmp_path / "dive.rrd", "/depth/estimate")
    assert values == [0.0, 0.0, 0.0, 0.0, 1.0, 1.0]
    np.testing.assert_allclose(times, [0.0, 3.8, 4.0, 4.8, 5.0, 9.8], atol=1e-9)


def test_a_restart_in_mid_dive_writes_a_second_part_on_the_same_clock(
    tmp_path: Path, sample: Sample
) -> None:
    dive(tmp_path, sample, 2.0, restart=True).close()
    times, _ = read_back(tmp_path / "dive.part2.rrd", "/depth/truth")
    assert min(times) > 1.5
    assert (tmp_path / "dive.rrd").is_file()


def test_a_folder_that_cannot_be_written_is_one_sentence(tmp_path: Path) -> None:
    blocked = tmp_path / "file"
    blocked.write_text("not a folder")
    with pytest.raises(LindyError, match=r"cannot write .*file/dive\.rrd: .*--out"):
        VirtualHost().add("visualizer", BOTH_REALMS, Stack(out=str(blocked)), wire)


def test_without_rerun_the_sentence_says_how_to_get_it(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.delitem(sys.modules, "services.visualizer.io.rerun_writer", raising=False)
    monkeypatch.setitem(sys.modules, "rerun", None)
    with pytest.raises(LindyError, match=r"needs rerun, .*`uv sync --extra viewer`"):
        VirtualHost().add("visualizer", BOTH_REALMS, Stack(out=str(tmp_path)), wire)


class Heard:
    """What a `LiveViewer` counted and logged."""

    def __init__(self) -> None:
        self.counts: list[str] = []
        self.lines: list[tuple[str, str]] = []

    def open(self, viewer: list[str]) -> tuple[LiveViewer, RerunWriter]:
        live = LiveViewer(viewer, lambda event: self.counts.append(event.name), self.log)
        writer = RerunWriter("test", Stack().section("vehicle", Vehicle))
        writer.save(live)
        return live, writer

    def log(self, level: str, text: str) -> None:
        self.lines.append((level, text))


def big_batch() -> Batch:
    return Batch(notes=[Note("status", 0, "document", "x" * 100_000)])


def test_the_viewer_reads_all_of_it_and_outlives_the_dive(tmp_path: Path) -> None:
    """rerun's own program, which has no window here but keeps what it reads."""
    program, stdin, *more = viewer_command()
    kept = tmp_path / "seen.rrd"
    live, writer = Heard().open([program, stdin, *more, "--save", str(kept)])
    for k in range(3):
        writer.write(Batch(columns=[CurveColumns("depth/estimate", [k * SECOND], [[float(k)]])]))
    writer.close()
    viewer = live.viewer
    assert viewer is not None
    assert viewer.wait(PATIENCE_S) == 0
    times, values = read_back(kept, "/depth/estimate")
    assert dict(zip(times, values, strict=True)) == {0.0: 0.0, 1.0: 1.0, 2.0: 2.0}


def test_a_stalled_viewer_holds_up_nothing() -> None:
    heard = Heard()
    live, writer = heard.open([sys.executable, "-c", "import time; time.sleep(600)"])
    while "dropped:live" not in heard.counts:
        writer.write(big_batch())
    writer.close()
    viewer = live.viewer
    assert viewer is not None
    assert viewer.poll() is None
    viewer.kill()
    viewer.wait()


def test_a_viewer_that_cannot_open_is_said_once_and_counted() -> None:
    heard = Heard()
    live, writer = heard.open(["/nonexistent/viewer"])
    until(lambda: writer.write(big_batch()) or heard.counts)  # a thread notices
    writer.write(big_batch())
    assert heard.counts == ["lost:live_viewer"]
    assert [level for level, _ in heard.lines] == ["info", "warning"]
    assert not live.is_open
