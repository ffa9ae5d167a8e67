"""`lindy import`: a real log becomes a recording."""

import json
from collections.abc import Sequence
from pathlib import Path
from typing import Annotated, NamedTuple

import msgspec
from cyclopts import Parameter

from messages.text import harmless
from services.runtime.config.errors import LindyError
from tools.choices import named
from tools.fresh import write_fresh
from tools.importing.choosing import chosen, listed, missing, unfit, untaken
from tools.importing.conversion import Conversion
from tools.importing.dataflash_file import DataflashFile, is_dataflash
from tools.importing.log_file import BY_FILE, LogFile, LogSource
from tools.importing.map_file import ImportMap, TakenMessage, read_map
from tools.importing.mcap_file import McapLog, is_mcap
from tools.importing.new_recording import NewRecording, attached_map, new_folder
from tools.importing.oddities import Oddity, in_words
from tools.importing.rosbag_file import RosbagFile, is_rosbag
from tools.importing.several_files import SeveralFiles
from tools.importing.table_file import TableFile, is_table
from tools.importing.tlog_file import TlogFile, is_tlog
from tools.importing.ulog_file import UlogFile, is_ulog
from tools.live.dive_folder import DIVES

REPORT = "import.json"
UNTAKEN = 8  # of what a log also has, so many are printed
TAKES = (
    "a bag of ROS 1 (.bag) or of ROS 2 (its folder), a recording of another program (.mcap), a log "
    "of ArduSub (.bin), of a ground station (.tlog) or of PX4 (.ulg), or a table (.csv, .parquet)"
)


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
    first: Annotated[Path, Parameter(name="file", converter=named, help=f"{TAKES}")],
    /,
    *more: Annotated[
        Path,
        Parameter(converter=named, help="of the same format and dive, by the same clock"),
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
            help="that it is of: a name in deploy/vehicles, or the path of a TOML file; default: "
            "that of the map"
        ),
    ] = None,
) -> int:
    """Make a recording of a log that another program wrote.

    FILE is a bag of ROS 1 (.bag) or of ROS 2 (its folder), a recording of another program (.mcap),
    a log of ArduSub (.bin), of a ground station (.tlog) or of PX4 (.ulg), or a table (.csv,
    .parquet). Several files of one clock, such as a table for each sensor or the pieces of a bag,
    become one recording, which `lindy log` and `lindy replay` read. What is odd in the log is
    counted, printed and written into import.json beside it.

    Example: lindy import 00000042.BIN
             lindy import pool.bag --map my_topics.toml --vehicle my_rov.toml --out dives/pool
             lindy import imu.csv pressure.csv --map my_columns.toml
    """
    files = [first, *more]
    log = opened_all(files)
    wanted, path = read_map(map_ or log.default_map)
    sources = log.sources()
    taken = chosen(wanted, sources, ", ".join(map(str, files)))
    given = LogInput(files, wanted, path, taken, sources)
    with new_folder(out or DIVES / first.stem) as folder:
        report = _imported(log, given, vehicle, folder)
        report.remarks += unfit(wanted, sources, [*report.sources])
        data = json.dumps(msgspec.to_builtins(report), indent=1, ensure_ascii=False).encode()
        write_fresh(folder / REPORT, data + b"\n")
    print(harmless(as_text(report, folder)), flush=True)
    return 0


class LogInput(NamedTuple):
    """What is imported, by which map."""

    files: list[Path]
    map: ImportMap
    map_path: Path
    taken: dict[str, list[TakenMessage]]  # by source
    sources: dict[str, LogSource]  # all that the log has

    @property
    def name(self) -> str:
        return ", ".join(path.name for path in self.files)


def opened_all(files: Sequence[Path]) -> LogFile:
    """
    Raises:
        LindyError: as `opened`, a file is named twice, or they are of different formats.
    """
    for path in files:
        if files.count(path) > 1:
            raise LindyError(f"{path} is named twice")
    logs = {path: opened(path) for path in files}
    return logs[files[0]] if len(files) == 1 else SeveralFiles(logs)


def opened(path: Path) -> LogFile:
    """The log, by its name.

    Raises:
        LindyError: there is none, or it is of no format that is read.
    """
    if not path.exists():
        raise LindyError(f"there is no file {path}")
    if is_rosbag(path):
        return RosbagFile(path)
    if is_tlog(path):
        return TlogFile(path)
    if is_dataflash(path):
        return DataflashFile(path)
    if is_mcap(path):
        return McapLog(path)
    if is_ulog(path):
        return UlogFile(path)
    if is_table(path):
        return TableFile(path)
    raise LindyError(f"{path}: this is not read; expected {TAKES}")


def _imported(log: LogFile, given: LogInput, vehicle: str | None, folder: Path) -> ImportReport:
    """
    Raises:
        LindyError: the log is damaged, the map does not fit, or the disk is full.
    """
    began = given.map.began
    began_ns = None if began is None else round(began.timestamp() * 1e9)
    name = vehicle or given.map.vehicle
    try:
        new = NewRecording(folder, name, attached_map(given.map_path), given.name)
        conversion = Conversion(given.taken, began_ns, log.getter, new.imu_rotation)
        for row in log.rows(given.taken):
            conversion.hear(row)
        conversion.heard()
        with new as recording:
            for row in log.rows(given.taken):
                for message in conversion.messages(row):
                    recording.write(message)
            conversion.finish()
    except LindyError as error:
        said = str(error)
        if any(path.name in said for path in given.files):
            raise
        raise LindyError(f"{', '.join(map(str, given.files))}: {said}") from None
    by_key: dict[str, list[str]] = {}
    for source, several in given.taken.items():
        for each in several:
            by_key.setdefault(each.as_, []).append(source)
    return ImportReport(
        file=given.name,
        map=given.map_path.name,
        vehicle=recording.vehicle,
        seconds=round(conversion.clock.elapsed_s, 3),
        messages=conversion.counts,
        sources=by_key,
        missing=missing(given.taken),
        untaken=untaken(given.taken, given.sources),
        oddities=conversion.oddities.all(),
        remarks=[said for said in log.remarks if said != BY_FILE or began is None],
    )


def as_text(report: ImportReport, folder: Path) -> str:
    """What is printed at the end."""
    lines = [f"{report.file}, {report.seconds:.1f} s, as {report.vehicle}, by {report.map}:"]
    for key, count in report.messages.items():
        rate = f"{count / report.seconds:.1f} a second" if report.seconds > 0.0 else "at once"
        lines.append(f"  {key}: {count} messages, {rate}, from {', '.join(report.sources[key])}")
    lines += [f"odd: {in_words(odd)}" for odd in report.oddities]
    if report.missing:
        said = f"not taken by this map: {', '.join(report.missing)}"
        has = f"; the log also has {listed(report.untaken, UNTAKEN)}" if report.untaken else ""
        lines.append(said + has)
    return "\n".join([*lines, *report.remarks, f"recorded in {folder}"])
