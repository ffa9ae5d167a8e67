"""What reads input from outside, each as a function of bytes alone, and its corpus.

The law of each: it takes the input or refuses it by its own documented refusal. Whatever else is
raised, an error in Lindy itself, more than `MOST_S` of processor time or `MOST_MB` of memory is a
find. What is refused without an error (messages, packets) returns nothing.
"""

import json
import signal
from collections import Counter
from collections.abc import Callable, Generator
from contextlib import contextmanager, redirect_stderr, redirect_stdout, suppress
from functools import cache, partial
from io import StringIO
from pathlib import Path
from resource import RUSAGE_SELF, getrusage
from tempfile import TemporaryDirectory
from typing import Any, NamedTuple

import msgspec

from messages import topics
from messages.events import Outbox
from services.cockpit.core import Settings as CockpitSettings
from services.cockpit.page_messages import PageEvent, PageOpened, PageSaid, parsed
from services.cockpit.service import CockpitPages
from services.gamepad.core import PadProfile
from services.marine.vehicle import Vehicle
from services.mavlink_io.io.endpoint import FrameReader, header_of
from services.recorder.core import Intake
from services.recorder.foxglove.views import Views
from services.recorder.io.mcap_file import McapFile
from services.runtime.bus.envelope import Envelope
from services.runtime.config.errors import LindyError
from services.runtime.config.settings import DEPLOY, read
from services.runtime.config.stack import Stack, read_part
from services.runtime.hosts.registry import Registry
from services.runtime.hosts.virtual_host import VirtualHost
from services.runtime.node.gate import Gate
from services.tether.io.profile_file import named, read_trace
from tests.services.mavlink.test_any_packet import CODEC, Conversation
from tests.support.ardusub_double.cable import MS, Cable
from tests.tools.importing import logs
from tools.__main__ import main
from tools.checks import PilotChoice, checked, pilot_of
from tools.choices import Choices
from tools.importing.map_file import read_map
from tools.keys import certificates
from tools.keys.credentials import parse_list
from tools.recordings.dive_file import flown_dive
from tools.recordings.mcap_records import records
from tools.recordings.recording import log_hash, open_recording

CORPUS = Path(__file__).parent / "corpus"
MOST_S = 5.0  # [s] of processor time for one input; a person waits a second
MOST_MB = 400.0  # that one input may add to the memory
SECOND = 1_000_000_000
MESSAGES = "bare.mcap"  # has the first two messages of each topic of a simulated dive


class TooMuch(BaseException):
    """Of time or memory; no reader may catch it."""


class Target(NamedTuple):
    folder: str  # of its corpus
    read: Callable[[bytes, Path], None]  # an input, and an empty folder of its own
    shipped: str = ""  # folder in deploy/ whose files are of its corpus, too

    def corpus(self) -> dict[str, bytes]:
        """Inputs by their names, the smallest first: what is found is then made of that."""
        folders = [CORPUS / self.folder, *([DEPLOY / self.shipped] if self.shipped else [])]
        found = {path.name: path.read_bytes() for each in folders for path in each.glob("*")}
        found |= EXTRA.get(self.folder, dict)()
        return dict(sorted(found.items(), key=lambda each: (len(each[1]), each[0])))


def obey(target: Target, data: bytes) -> None:
    """
    Raises:
        TooMuch: of time or memory.
        Exception: anything but the target's own refusal.
    """
    before = getrusage(RUSAGE_SELF).ru_maxrss
    with TemporaryDirectory(prefix="lindy-fuzz-") as folder, _hurried():
        target.read(data, Path(folder))
    grown = (getrusage(RUSAGE_SELF).ru_maxrss - before) / 1024
    if grown > MOST_MB:
        raise TooMuch(f"{grown:.0f} MB of memory for {len(data)} bytes")


@contextmanager
def _hurried() -> Generator[None]:
    def late(*_: object) -> None:
        raise TooMuch(f"more than {MOST_S:g} s of processor time")

    before = signal.signal(signal.SIGPROF, late)
    signal.setitimer(signal.ITIMER_PROF, MOST_S)
    try:
        yield
    finally:
        signal.setitimer(signal.ITIMER_PROF, 0.0)
        signal.signal(signal.SIGPROF, before)


# The gate: lines of a key and a message, MessagePack as it is on the bus.


def gate(data: bytes, _: Path) -> None:
    counts, lost = Counter[str](), Outbox()
    intake = Intake(lost, views=Views(Stack().section("vehicle", Vehicle)))
    name, _space, payload = data.partition(b" ")
    key = name.decode("ascii", "replace")
    topic = topics.find(key)
    if topic is not None:
        for onlooker in (False, True):
            gate = Gate(topic, Outbox(counts), onlooker=onlooker)
            gate.admit(Envelope(key, payload, topic.encoding), SECOND)
        assert {*counts.values()} <= {1, 2}
    encoding = topics.STATE.encoding if topic is None else topic.encoding
    if (found := intake.check(key, encoding, payload, SECOND)) is not None:
        intake.rows(key, found)


def messages() -> dict[str, bytes]:
    """One of each topic."""
    lines = (CORPUS / "gate" / "more.jsonl").read_text(encoding="utf-8").splitlines()
    told = [line.partition(" ")[::2] for line in lines]
    told += [
        (raw.key, raw.data.decode())
        for raw in open_recording(CORPUS / "recording" / MESSAGES).raw()
    ]
    found = dict[str, bytes]()
    for key, text in told:
        topic = topics.find(key)
        assert topic is not None
        message = msgspec.json.decode(text, type=topic.message)
        found[key] = key.encode() + b" " + msgspec.msgpack.encode(message)
    return found


# MAVLink: what a ground station says to Lindy, and a board to its driver.


def mended(data: bytes) -> bytes:
    """Every frame with the checksum that fits what became of it."""
    from pymavlink.generator.mavcrc import x25crc  # pyright: ignore[reportMissingTypeStubs]

    extras: dict[int, int] = {kind.id: kind.crc_extra for kind in CODEC.types.values()}
    out, at = bytearray(data), 0
    while (at := data.find(b"\xfd", at)) >= 0 and at + 12 <= len(data):
        end = at + 10 + data[at + 1]
        frame = data[at : end + 2]
        if len(frame) == data[at + 1] + 12 and (extra := extras.get(header_of(frame)[2])):
            check: Any = x25crc(data[at + 1 : end] + bytes([extra]))
            out[end : end + 2] = int(check.crc).to_bytes(2, "little")
            at = end + 2
        else:
            at += 1
    return bytes(out)


def ground_station(data: bytes, _: Path) -> None:
    for said in (data, mended(data)):
        Conversation().hear(said)


def board(data: bytes, _: Path) -> None:
    for said in (data, mended(data)):
        cable = Cable("4.8")
        cable.dumb = True
        for packet in FrameReader(CODEC).read([said], link="udp a"):
            cable.now += 10 * MS
            cable.driver.hear(packet, cable.now)
            cable.driver.tick(cable.now)
            for sent in cable.driver.take().packets:
                CODEC.encode(sent)


# The cockpit's page: a message a line.


class Pages:
    """Connections of which only the other end is played."""

    def __init__(self) -> None:
        self.waiting: list[PageEvent] = []

    def received(self) -> list[PageEvent]:
        taken, self.waiting = self.waiting, []
        return taken

    def show(self, texts: Any) -> None:
        for text in texts.values():
            json.loads(text)


def page(data: bytes, _: Path) -> None:
    host, pages = VirtualHost(), Pages()
    node = host.node("cockpit", ["topside"])
    cockpit = CockpitPages(node, CockpitSettings(), Stack().section("vehicle", Vehicle), pages)
    status = host.node("reference", ["topside"]).publisher(topics.STATUS)
    pages.waiting = [PageOpened(1, watcher=False), PageOpened(2, watcher=True)]
    for number, line in enumerate(data.split(b"\n")[:40]):
        # A page sends text; what is no text ends its connection before.
        said = line.decode("utf-8", "replace")
        pages.waiting += [PageSaid(1 + number % 7 // 6, parsed(said)), PageSaid(3, parsed(line))]
        cockpit.receive(host.now)
        if number % 4 == 0:
            status.put(
                msgspec.convert(
                    {"stamp_ns": host.now, "activity": "ready", "armed": number > 8, "epoch": 1},
                    topics.STATUS.message,
                )
            )
        host.run(host.now + SECOND // 20)


# Recordings: the reader itself, and each verb that prints what a stranger wrote.


def recording(data: bytes, folder: Path) -> None:
    path = folder / "dive.mcap"
    path.write_bytes(data)
    for _ in records(path):
        pass
    try:
        opened = open_recording(path)
        for _ in opened:
            pass
        opened.origin_ns()
        opened.keys()
        log_hash(path)
        flown_dive(opened)
    except LindyError:
        return
    assert isinstance(opened.damage, list)


def command(
    name: str, *words: str, out: str = "", statuses: tuple[int, ...] = (0, 1, 3)
) -> Callable[[bytes, Path], None]:
    """A command over FILE, which is called so."""

    def run(data: bytes, folder: Path) -> None:
        path = folder / name
        path.write_bytes(data)
        more = ["--out", str(folder / out)] if out else []
        status, text = said([word.replace("FILE", str(path)) for word in (*words, *more)])
        assert status in statuses, status
        assert not any(ord(c) < 32 and c not in "\n\t" for c in text), text
        assert path.read_bytes() == data

    return run


def said(words: list[str]) -> tuple[int, str]:
    printed = StringIO()
    with redirect_stdout(printed), redirect_stderr(printed):
        status = main(words)
    assert "in Lindy itself" not in printed.getvalue(), printed.getvalue()
    return status, printed.getvalue()


def recordings() -> dict[str, bytes]:
    """The same messages as Lindy's recorder writes them: compressed, with checksums."""
    with TemporaryDirectory() as folder:
        file = McapFile(Path(folder) / "dive.mcap")
        file.metadata("dive", {"vehicle": "pioneer", "side": "drone"})
        for number, raw in enumerate(open_recording(CORPUS / "recording" / MESSAGES).raw()):
            if not file.has_channel(raw.key):
                topic = topics.find(raw.key)
                assert topic is not None
                file.open_channel(raw.key, topic.message.__name__, b"{}")
            file.write(raw.key, raw.data, raw.log_ns, raw.publish_ns, raw.sequence)
            if number % 20 == 19:
                file.metadata("here", {"a chunk": "ends"})
        file.metadata("losses", {"overflowed:**": "2"})
        file.finish()
        return {"as Lindy writes it": file.path.read_bytes()}


# Logs of other programs.


def made(name: str) -> dict[str, bytes]:
    """A log by the format's own library."""
    with TemporaryDirectory() as folder:
        path = Path(folder) / name
        FOREIGN[name](path)
        return {name: path.read_bytes()}


def table(path: Path) -> None:
    columns = [f"{of}.{axis}" for of in ("angular_rate", "specific_force") for axis in "xyz"]
    rows = [
        f"{logs.BEGAN_NS + k * SECOND // 50},{k % 7 / 9},{k % 5},0.1,0,{k % 3},-9.8"
        for k in range(80)
    ]
    path.write_text("\n".join([",".join(["publish_ns", *columns]), *rows]))


FOREIGN: dict[str, Callable[[Path], object]] = {
    "log.bag": logs.ros1, "log.bin": logs.dataflash, "log.tlog": logs.tlog, "log.ulg": logs.ulog,
    "log.mcap": logs.mcap, "sensor_imu.csv": table,
}  # fmt: skip


# Files that are read when a dive begins.


def text(read: Callable[[Path], object], suffix: str = ".toml") -> Callable[[bytes, Path], None]:
    def run(data: bytes, folder: Path) -> None:
        # Files are remembered by their paths, and each input is to be another file.
        path = folder / f"f{folder.name[-8:]}{suffix}".lower()
        path.write_bytes(data)
        refused = refusal(lambda: read(path))
        assert not refused or path.name in refused, refused  # where it is wrong

    return run


def refusal(read: Callable[[], object]) -> str:
    """Empty: it was taken."""
    try:
        read()
    except LindyError as refused:
        return str(refused)
    return ""


@cache
def simulated() -> Registry:
    return Registry.read()


def vehicle(path: Path) -> None:
    checked(Choices(vehicle=str(path)), PilotChoice("gamepad"), simulated())


def stack(path: Path) -> None:
    found = Registry.read(str(path))
    found.require_whole()
    for each in (found, found.apart(), found.grouped()):
        assert each.watched is not None
        assert each.vehicle_side is not None


def path_file(path: Path) -> None:
    said(["path", str(path)])
    said(["path", str(path), "--dt", "1"])
    script = path.with_suffix(".csv")
    script.write_text(f"t,surge,sway,heave,yaw,event\n0,0,0,0,0,follow {path}\n9,0,0,0,0,\n")
    refused = refusal(lambda: pilot_of(f"script:{script}"))
    assert not refused or script.name in refused, refused


def script(path: Path) -> None:
    pilot_of(f"script:{path}")


def admitted(data: bytes, _: Path) -> None:
    with suppress(ValueError):
        parse_list(data.decode(errors="replace"))


def issued_by(data: bytes) -> object:
    return certificates.check_certificate(
        data, (CORPUS / "certificate/authority.pem").read_bytes(), None
    )


def issued_to(data: bytes) -> object:
    return certificates.check_certificate(
        (CORPUS / "certificate/pilot.pem").read_bytes(), data, None
    )


JUDGES: tuple[Callable[[bytes], object], ...] = (
    certificates.read, certificates.read_key, certificates.public_key,
    issued_by, issued_to,
)  # fmt: skip


def certificate(data: bytes, _: Path) -> None:
    for judge in JUDGES:
        with suppress(ValueError):
            judge(data)


EXTRA: dict[str, Callable[[], dict[str, bytes]]] = {
    "gate": messages,
    "recording": recordings,
    **{name: partial(made, name) for name in FOREIGN},
}
# Verbs over a recording: their names, words, and what they write.
VERBS: dict[str, tuple[str, str]] = {
    "log info": ("log info FILE", ""),
    "log check": ("log check FILE", ""),
    "log csv": ("log export --as csv FILE", "tables"),
    "log rosbag": ("log export --as rosbag FILE", "bag"),
    "log cut": ("log cut FILE --from 0.1", "cut.mcap"),
    "log recover": ("log recover FILE", "whole.mcap"),
    "log compare": (f"log compare FILE {CORPUS / 'recording' / MESSAGES}", ""),
    "log sticks": ("log export --as sticks FILE", "sticks.csv"),
    "calibrate noise": ("calibrate noise FILE", ""),
    "log snapshots": ("log snapshots FILE", "pictures"),
    "link trace": ("log export --as trace FILE", "trace.csv"),
    "review": ("review FILE", "page.html"),
    "replay": ("replay FILE --through control --diff", ""),
    "identify": ("identify FILE", ""),
    "calibrate": ("calibrate gyroscope FILE", ""),
}
TARGETS: dict[str, Target] = {
    "gate": Target("gate", gate),
    "ground station": Target("mavlink", ground_station),
    "board": Target("mavlink", board),
    "page": Target("page", page),
    "recording": Target("recording", recording),
    **{
        name: Target("recording", command("dive.mcap", *words.split(), out=out))
        for name, (words, out) in VERBS.items()
    },
    "vehicle": Target("vehicle", text(vehicle), "vehicles"),
    "stack": Target("stack", text(stack), "stacks"),
    "link": Target("link", text(lambda path: named(str(path))), "links"),
    "pad": Target("pad", text(lambda path: read(path, PadProfile)), "pads"),
    "path": Target("path", text(path_file), "paths"),
    "sensor": Target("sensor", text(read_part), "sensors"),
    "map": Target("map", text(lambda path: read_map(str(path))), "imports"),
    "script": Target("script", text(script, ".csv"), "dives"),
    "trace": Target("trace", text(read_trace, ".csv")),
    "admitted": Target("admitted", admitted),
    "certificate": Target("certificate", certificate),
    **{
        f"import {name}": Target(name, command(name, "import", "FILE", out="dive", statuses=(0, 1)))
        for name in FOREIGN
    },
}
