"""`lindy import`: a real log becomes a recording, written by what writes that of a dive."""

import contextlib
import json
from collections.abc import Callable, Generator, Iterator, Sequence
from contextlib import contextmanager
from itertools import chain
from pathlib import Path
from typing import Annotated

import msgspec
from cyclopts import Parameter

from messages import events
from messages.text import harmless
from services.marine.vehicle import Vehicle
from services.recorder.core import Intake
from services.recorder.foxglove.views import Views
from services.recorder.io.attachments import AttachedFile, attachments
from services.recorder.io.mcap_session import McapSession
from services.recorder.io.parts import part_path
from services.runtime.config.errors import LindyError
from services.runtime.config.stack import Stack
from services.runtime.hosts.virtual_host import VirtualHost
from tools.choices import named
from tools.fresh import write_fresh
from tools.importing.ardupilot_files import DataflashFile, TlogFile
from tools.importing.column_files import PARQUET, TableFile, UlogFile
from tools.importing.contradictions import Oddity
from tools.importing.conversion import Conversion, Imported
from tools.importing.log_file import BY_FILE, LogFile, chosen, listed, missing, unfit, untaken
from tools.importing.map_file import read_map
from tools.importing.rosbag_file import McapLog, RosbagFile, is_rosbag
from tools.importing.several_files import SeveralFiles
from tools.live.dive_folder import DIVES, out_folder, point_latest
from tools.text_table import counted

FLUSHED = 5_000  # messages between two flushes
BEFORE_NS = 10_000_000_000  # [ns] by the clock of the stamps at the first message


def record(
    messages: Iterator[Imported], stack: Stack, vehicle: Vehicle, used: Path, log: str
) -> None:
    """
    Args:
        messages: one or more, in the order of their arrival.
        stack: of which vehicle, into which folder.
        used: the map.
        log: name of the file that they are from.

    Raises:
        LindyError: the disk fails, or a message is none of ours.
    """
    data, changed_ns = used.read_bytes(), used.stat().st_mtime_ns
    own_map = AttachedFile(used.name, "application/toml", data, changed_ns)
    attached, views = [*attachments(stack), own_map], Views(vehicle)
    first = next(messages)
    host, said = VirtualHost(), list[str]()  # what the disk failed with
    host.now = BEFORE_NS
    node = host.node("import", ["drone"])
    node.wall_offset_ns = offset = first.arrival_ns - BEFORE_NS
    node.show = lambda line: said.append(line.text) if line.level == "error" else None
    encode, intake = msgspec.msgpack.Encoder().encode, Intake(node.outbox, offset, views=views)
    session = McapSession(node, stack, attached, {"imported": log})

    def require_disk() -> None:
        if said or node.outbox.counts[events.NOT_RECORDED().name]:
            raise LindyError(" ".join(said) or "the recording could not be written")

    try:
        for number, (topic, message, arrival) in enumerate(chain([first], messages), 1):
            # By the clock of the services of a dive, which is never UTC.
            stamps = ((name, getattr(message, name, None)) for name in ("stamp_ns", "actuated_ns"))
            changed = {name: at - offset for name, at in stamps if at is not None}
            ours = msgspec.structs.replace(message, **changed)
            checked = intake.check(topic.key, topic.encoding, encode(ours), arrival - offset)
            if checked is None:
                raise LindyError(f"{topic.key}: this cannot be recorded: {ours}")
            for row in intake.rows(topic.key, checked):
                session.write(row)
            if number % FLUSHED == 0:
                session.flush(node.now())
                require_disk()
        session.flush(node.now())
    finally:
        session.close(intake.log_hash())
    require_disk()


@contextmanager
def new_folder(out: Path) -> Generator[Path]:
    """A folder for a recording, as `lindy dive` makes it; where the import fails, nothing of it
    stays.

    Raises:
        LindyError: it cannot be made or written to.
    """
    missing = [path for path in (out.resolve(), *out.resolve().parents) if not path.exists()]
    folder = out_folder(out)
    new = [folder] if folder not in missing else missing
    try:
        yield folder
    except BaseException:
        part_path(folder, 1).unlink(missing_ok=True)
        for path in new:
            with contextlib.suppress(OSError):
                path.rmdir()
        raise
    point_latest(folder)


REPORT = "import.json"
UNTAKEN = 8  # of what a log also has, so many are printed
TAKES = (
    "a bag of ROS 1 (.bag) or of ROS 2 (its folder), a recording of another program (.mcap), a log "
    "of ArduSub (.bin), of a ground station (.tlog) or of PX4 (.ulg), or a table "
    "(.csv, .tsv, .txt, .parquet)"
)

Format = Callable[[Path], LogFile]
BEGINNINGS: dict[bytes, Format] = {  # how a file begins
    b"\x89MCAP0\r\n": McapLog,
    b"#ROSBAG V2.0": RosbagFile,
    b"ULog\x01\x12\x35": UlogFile,
    b"\xa3\x95\x80": DataflashFile,
    PARQUET: TableFile,
}
ENDINGS: dict[str, Format] = {  # how the name of another one ends
    ".tlog": TlogFile,
    **dict.fromkeys((".csv", ".tsv", ".txt"), TableFile),  # Excel writes its Unicode text as .txt
}


class ImportReport(msgspec.Struct, kw_only=True):
    """What `import.json` says."""

    file: str  # name of the log; of several, with commas between them
    map: str
    vehicle: str
    seconds: float  # [s] from the first row to the last
    messages: dict[str, int]  # by key
    sources: dict[str, list[str]]  # key → what of the log it is from
    missing: list[str]  # keys that a log can give and this one does not
    untaken: list[str]  # what this log has and the map does not take, the likeliest first
    oddities: list[Oddity]
    remarks: list[str]


def import_log(
    first: Annotated[Path, Parameter(name="file", converter=named, help=TAKES)],
    /,
    *more: Annotated[
        Path,
        Parameter(
            converter=named, help="further files of the same format and dive, by the same clock"
        ),
    ],
    map_: Annotated[
        str | None,
        Parameter(
            name="--map",
            help="what is which sensor: a name in deploy/imports, or the path of a TOML file; "
            "default: that of the format",
        ),
    ] = None,
    out: Annotated[
        Path | None,
        Parameter(
            converter=named,
            help="folder for the recording; where it holds a dive already, a new one beside it; "
            "default: dives/ and the name of FILE",
        ),
    ] = None,
    vehicle: Annotated[
        str | None,
        Parameter(
            help="the vehicle: a name in deploy/vehicles, or the path of a TOML file; default: "
            "that of the map"
        ),
    ] = None,
) -> int:
    """Make a recording of a log that another program wrote.

    Several files of one clock, such as a table for each sensor or the pieces of a bag, become one
    recording, which `lindy log` and `lindy replay` read. What is odd in the log is counted, printed
    and written into import.json beside it.

    Example: lindy import 00000042.BIN
             lindy import pool.bag --map my_topics.toml --vehicle my_rov.toml --out dives/pool
             lindy import imu.csv pressure.csv --map my_columns.toml
    """
    folder, report = _imported([first, *more], map_, vehicle, out or DIVES / first.stem)
    print(harmless(as_text(report, folder)), flush=True)
    return 0


def _imported(
    files: list[Path], map_: str | None, vehicle: str | None, out: Path
) -> tuple[Path, ImportReport]:
    """The folder, and what is in it.

    Raises:
        LindyError: the log is damaged, the map does not fit, or the disk is full.
    """
    log = opened_all(files)
    wanted, path = read_map(map_ or log.default_map)
    sources = log.sources()
    name = ", ".join(path.name for path in files)
    began_ns = None if wanted.began is None else round(wanted.began.timestamp() * 1e9)
    try:
        taken = chosen(wanted, sources, ", ".join(map(str, files)))
        stack = Stack(vehicle=vehicle or wanted.vehicle, link="perfect", pilot="imported")
        hull = stack.section("vehicle", Vehicle)
        mounted, changed = hull.mounting.imu.rotation, log.changed_ns
        conversion = Conversion(log.rows(taken), taken, began_ns, log.getter, mounted, changed)
        messages = conversion.messages()
        first = next(messages)  # what is refused is refused before there is a folder
    except LindyError as error:
        said = "; ".join([str(error), *log.remarks])
        if any(path.name in str(error) for path in files):
            raise LindyError(said) from None
        raise LindyError(f"{', '.join(map(str, files))}: {said}") from None
    by_key: dict[str, list[str]] = {}
    for source, several in taken.items():
        for each in several:
            by_key.setdefault(each.as_, []).append(source)
    for remark in conversion.remarks:
        log.say(remark)
    with new_folder(out) as folder:
        stack = msgspec.structs.replace(stack, out=str(folder))
        record(chain([first], messages), stack, hull, path, name)
        remarks = [said for said in log.remarks if said != BY_FILE or wanted.began is None]
        report = ImportReport(
            file=name,
            map=path.name,
            vehicle=hull.name or stack.vehicle_name,
            seconds=round(conversion.seconds, 3),
            messages=conversion.counts,
            sources=by_key,
            missing=missing(taken),
            untaken=untaken(taken, sources),
            oddities=conversion.oddities.all(),
            remarks=[*remarks, *unfit(wanted, sources, [*by_key])],
        )
        data = json.dumps(msgspec.to_builtins(report), indent=1, ensure_ascii=False).encode()
        write_fresh(folder / REPORT, data + b"\n")
    return folder, report


def opened_all(files: Sequence[Path]) -> LogFile:
    """
    Raises:
        LindyError: as `opened`, a file is named twice, or they are of different formats.
    """
    for path in files:
        if files.count(path) > 1:
            raise LindyError(f"{path} is named twice")
    logs = [opened(path) for path in files]
    return logs[0] if len(logs) == 1 else SeveralFiles(logs)


def opened(path: Path) -> LogFile:
    """The log, by how it begins; a table and a log of a ground station by its name.

    Raises:
        LindyError: there is none, or it is of no format that is read.
    """
    if not path.exists():
        raise LindyError(f"there is no file {path}")
    if is_rosbag(path):
        return RosbagFile(path)
    beginning = b""
    if path.is_file():
        with path.open("rb") as file:
            beginning = file.read(max(map(len, BEGINNINGS)))
        if not beginning:
            raise LindyError(f"{path} is empty")
    kinds = (kind for magic, kind in BEGINNINGS.items() if beginning.startswith(magic))
    kind = next(kinds, ENDINGS.get(path.suffix.lower()))
    if kind is None:
        begins = f" and begins with {beginning[:8]!r}" if beginning else ""
        raise LindyError(f"{path} is no log that is read{begins}; expected {TAKES}")
    return kind(path)


def as_text(report: ImportReport, folder: Path) -> str:
    """What is printed at the end."""
    lines = [f"{report.file}, {report.seconds:.1f} s, as {report.vehicle}, by {report.map}:"]
    for key, count in report.messages.items():
        rate = f"{count / report.seconds:.1f} a second" if report.seconds > 0.0 else "at once"
        of = f"{counted(count, 'message')}, {rate}, from {', '.join(report.sources[key])}"
        lines.append(f"  {key}: {of}")
    lines += [f"odd: {odd.in_words}" for odd in report.oddities]
    if report.missing:
        said = f"not taken by this map: {', '.join(report.missing)}"
        has = f"; the log also has {listed(report.untaken, UNTAKEN)}" if report.untaken else ""
        lines.append(said + has)
    return "\n".join([*lines, *report.remarks, f"recorded in {folder}"])
