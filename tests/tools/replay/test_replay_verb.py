"""`lindy replay` as it is typed: every mistake is one sentence, and what can be done is done."""

from collections.abc import Callable
from io import BytesIO
from pathlib import Path

import msgspec
import pytest
from mcap.reader import make_reader

from messages import topics
from messages.identity import SideIdentity
from services.recorder.foxglove.channel import foxglove_schema
from services.recorder.io.mcap_file import McapFile
from services.runtime.bus.envelope import Envelope
from services.runtime.bus.memory_bus import MemoryBus, MemoryBusPort
from services.runtime.config.stack import Stack
from services.runtime.node.checkpoint import VolatileCheckpoint
from services.runtime.node.node import Node
from services.visualizer.service import wire
from tests.golden.dives import golden
from tools.__main__ import main
from tools.replay.play import Replay, Republisher
from tools.replay.source import open_source

GOLDEN = str(golden("pioneer"))
THROUGH = ("--through", "control", "--diff")


def complaint(capsys: pytest.CaptureFixture[str], *arguments: str) -> str:
    """What `lindy replay` says where it must fail well."""
    assert main(["replay", *arguments]) == 1
    out, err = capsys.readouterr()
    assert err.startswith("lindy: ")
    assert err.count("\n") == 1
    assert "Traceback" not in err
    assert "error in Lindy" not in err
    assert out == "" or "was not finished" in out
    return err


@pytest.mark.parametrize(
    ("arguments", "says"),
    [
        (["--speed", "0"], "--speed is 0, expected 0.01 to 1000"),
        (["--speed", "-2"], "--speed is -2"),
        (["--speed", "nan"], "--speed is nan"),
        (["--from", "5", "--to", "4"], "--from 5 is not before --to 4"),
        (["--from", "4001", "--to", "4000"], "--from 4001 is not before --to 4000"),
        (["--from", "4000"], "--from is 4000 s, but the recording ends after 11.0 s"),
        (["--from", "nan"], "--from is nan, expected seconds from 0 to 11.0"),
        (["--to", "-1"], "--to is -1, expected seconds"),
        (["--listen", "tcp/0.0.0.0:7447"], "a replay stays on this machine"),
        (["--listen", "somewhere"], "expected PROTOCOL/ADDRESS:PORT"),
        (["--topics", "statte", "--headless"], "nothing of what is asked for is in it"),
        (["--through", "control"], "--through SERVICE and --diff go together"),
        (["--diff"], "--through SERVICE and --diff go together"),
        (["--tolerance", "state.*=1"], "are for --through SERVICE --diff"),
        (["--through", "contrl", "--diff"], "did you mean 'control'?"),
        (["--through", "simulator", "--diff"], "cannot"),
        (["--through", "predictor", "--diff"], "it did not run in that dive"),
        ([*THROUGH, "--tolerance", "state"], "expected TOPIC.FIELD=NUMBER"),
        ([*THROUGH, "--tolerance", "control/wrench.wnted=1"], "no message that is compared has"),
        (
            [*THROUGH, "--set", "control.depth.kp=-3"],
            "expected a number >= 0.0 N/m or N m/rad, found -3",
        ),
        ([*THROUGH, "--set", "contrl.depth.kp=3"], "did you mean 'control'?"),
    ],
)
def test_a_wrong_option_is_explained(
    capsys: pytest.CaptureFixture[str], arguments: list[str], says: str
) -> None:
    assert says in complaint(capsys, GOLDEN, *arguments)


def nothing(path: Path) -> None:
    path.write_bytes(b"")


def text(path: Path) -> None:
    path.write_text("t,surge\n0,0\n")


def foreign(path: Path) -> None:
    McapFile(path).finish()


def no_file(path: Path) -> None:
    assert not path.exists()


def only_its_beginning(path: Path) -> None:
    path.write_bytes(golden("pioneer").read_bytes()[:30])


@pytest.mark.parametrize("more", [["--headless"], [*THROUGH]])
@pytest.mark.parametrize(
    ("make", "says"),
    [
        (nothing, "is empty: there is nothing to replay"),
        (text, "is not a recording: it does not begin as MCAP files do"),
        (foreign, "is not a recording of Lindy"),
        (only_its_beginning, "is not a recording of Lindy, or is cut off"),
        (no_file, "No such file"),
    ],
)
def test_a_wrong_file_is_explained(
    capsys: pytest.CaptureFixture[str],
    tmp_path: Path,
    make: Callable[[Path], None],
    says: str,
    more: list[str],
) -> None:
    path = tmp_path / "dive.mcap"
    make(path)
    assert says in complaint(capsys, str(path), *more)


def test_what_is_left_of_a_cut_off_file_is_compared(
    capsys: pytest.CaptureFixture[str], tmp_path: Path
) -> None:
    path = tmp_path / "dive.mcap"
    whole = golden("pioneer").read_bytes()
    path.write_bytes(whole[: len(whole) // 2])
    together = [f for n in ("estimation", "reference", "control") for f in ("--through", n)]
    # Not its last moment: of the messages of one instant the cut may leave the answer alone.
    to_the_cut = ["--to", "5", "--tolerance", "*=1e-6"]
    assert main(["replay", str(path), *together, "--diff", *to_the_cut]) == 0
    out, _ = capsys.readouterr()
    assert "was not finished" in out
    assert "exactly as recorded" in out


def test_a_damaged_file_is_said_to_be_one(
    capsys: pytest.CaptureFixture[str], tmp_path: Path
) -> None:
    path = tmp_path / "dive.mcap"
    data = bytearray(golden("pioneer").read_bytes())
    summary = make_reader(BytesIO(data)).get_summary()
    assert summary is not None
    last = summary.chunk_indexes[-1]  # what comes behind a gap does not follow from what is read
    data[last.chunk_start_offset + last.chunk_length // 2] ^= 0xFF
    path.write_bytes(data)
    together = [f for n in ("estimation", "reference", "control") for f in ("--through", n)]
    whole = ["--to", "10", "--tolerance", "*=1e-6"]
    assert main(["replay", str(path), *together, "--diff", *whole]) == 0
    assert "is damaged at byte " in capsys.readouterr().out


def test_a_difference_is_said_and_is_the_exit_status(capsys: pytest.CaptureFixture[str]) -> None:
    together = [f for n in ("estimation", "reference", "control") for f in ("--through", n)]
    changed = ["--set", "control.depth.kp=120", "--tolerance", "*=1e-6", "--from", "6"]
    assert main(["replay", GOLDEN, *together, "--diff", *changed]) == 1
    out, _ = capsys.readouterr()
    assert "control/wrench: wanted[2]: first at 6." in out
    assert "fields differ" in out


def rewritten(
    path: Path,
    change: Callable[[str, dict[str, object]], None],
    clock: Callable[[int], int] = lambda ns: ns,
) -> Path:
    """The golden dive with every message changed, and what another Lindy said of itself."""
    source, file = open_source(golden("pioneer")), McapFile(path)
    file.metadata("dive", source.about)
    file.metadata("clock", {"utc_minus_stamp_ns": "0"})
    file.metadata("thinned", {"x": "y"})
    for each in source.recording.attachments():
        file.attach(each.name, each.media_type, each.data)
    said = SideIdentity(stamp_ns=0, side="drone", messages="0123456789ab", version="0.0")
    rows = [("identity/drone", msgspec.json.encode(said), 0, 0)]
    for key, data, log_ns, publish_ns, *_ in [*rows, *source.raw()]:
        if not file.has_channel(key):
            topic = topics.find(key)
            assert topic is not None
            file.open_channel(key, topic.message.__name__, foxglove_schema(topic.message))
        body = msgspec.json.decode(data)
        change(key, body)
        file.write(key, msgspec.json.encode(body), clock(log_ns), publish_ns, 0)
    file.finish()
    return path


def unchanged(_key: str, _body: dict[str, object]) -> None:
    pass


def test_other_messages_are_said_and_compared_as_far_as_possible(
    capsys: pytest.CaptureFixture[str], tmp_path: Path
) -> None:
    def older(key: str, body: dict[str, object]) -> None:
        if key == "control/wrench":
            body.pop("disturbance", None)  # one field fewer
        if key == "state":
            body["of_old"] = 1.0  # and one that nobody knows any more

    path = rewritten(tmp_path / "older.mcap", older)
    together = [f for n in ("estimation", "reference", "control") for f in ("--through", n)]
    one_more = ["--tolerance", "health/reference.*=2"]  # it heard the other Lindy
    arguments = [*together, "--diff", *one_more, "--tolerance", "*=1e-6"]
    assert main(["replay", str(path), *arguments]) == 0
    assert "it was made with other messages (hash 0123456789ab" in capsys.readouterr().out


def test_a_clock_that_runs_backwards_is_said(
    capsys: pytest.CaptureFixture[str], tmp_path: Path
) -> None:
    source = open_source(golden("pioneer"))
    times = [raw.log_ns for raw in source.raw()]
    half = times[len(times) // 2]
    path = rewritten(tmp_path / "back.mcap", unchanged, lambda ns: ns - 10**9 * (ns > half))
    assert main(["replay", str(path), *THROUGH]) == 1
    out, err = capsys.readouterr()
    assert "its clock runs backwards by 1.0 s" in out
    assert err == ""


def test_without_a_terminal_it_plays_and_says_what(capsys: pytest.CaptureFixture[str]) -> None:
    arguments = ["--from", "5", "--to", "5.5", "--speed", "2", "--headless", "--topics", "s*"]
    assert main(["replay", GOLDEN, *arguments]) == 0
    out, _ = capsys.readouterr()
    assert out.startswith(f"replay of {GOLDEN}: pioneer, 0.5 s at ×2\n")
    assert "\r" not in out
    asked = [r for r in open_source(golden("pioneer")).raw() if r.key[0] == "s"]
    expected = [r for r in asked if 5.0e9 <= r.log_ns - 10_000_000 <= 5.5e9]
    assert f"{len(expected)} messages of {len({r.key for r in expected})} topics" in out


# Our files have no index, by choice; the reader says so.
@pytest.mark.filterwarnings("ignore:RRD file has no footer")
def test_the_visualizer_shows_a_replay(tmp_path: Path) -> None:
    chunk = pytest.importorskip("rerun.chunk", reason="the viewer extra is not installed")
    hub, now = MemoryBus(), 10**12
    node = Node(
        "visualizer", {"topside": MemoryBusPort(hub)}, lambda: now, VolatileCheckpoint(),
        replay=True,
    )  # fmt: skip
    wire(node, Stack(out=str(tmp_path), replay=True))
    source, port = open_source(golden("pioneer")), MemoryBusPort(hub)
    out = Republisher(source.recording, port.forward)
    for raw in source.raw():
        now = 10**12 + raw.log_ns
        out.send(raw, now)
        node.step()
    node.close()
    assert out.sent > 4000
    assert not [name for name in node.counts if name.startswith(("replayed", "wrong_type"))]
    stream = chunk.RrdReader(str(tmp_path / "dive.rrd")).stream()
    shown = list(stream.filter(content="/depth/estimate", is_static=False))
    assert sum(part.to_record_batch().num_rows for part in shown) > 20


def test_to_the_end_every_message_once() -> None:
    source, hub, heard = open_source(golden("pioneer")), MemoryBus(), list[Envelope]()
    MemoryBusPort(hub).hear("**", heard.append)
    span = source.span[0] + 5_000_000_000, source.span[0] + 5_100_000_000
    assert Replay(source, span, MemoryBusPort(hub)).play(lambda: False) == 0
    assert len(heard) == sum(span[0] <= raw.log_ns <= span[1] for raw in source.raw())
    assert all(envelope.encoding.endswith(";replayed") for envelope in heard)
