"""`lindy log`: verbs that look into a recording, check, mend, cut, convert or compare it.

Every one takes a dive's folder, or one MCAP file; none changes it, or overwrites a file.
"""

from math import inf
from pathlib import Path
from typing import Annotated

from cyclopts import App, Parameter

from tools.choices import named

log = App(name="log", help="Look into recordings: check, cut, mend, convert or compare them.")
Json = Annotated[bool, Parameter(negative=(), show_default=False, help="no lines, JSON")]
Out = Annotated[Path, Parameter(converter=named, help="the file to write, a new one")]


@log.command
def info(recording: Path, *, json: Json = False) -> int:
    """What a recording is of, and what is in it: vehicle, versions, length, events, topics.

    RECORDING is a dive's folder or its MCAP file. Exit status 3: it is damaged or was not finished.

    Example: lindy log info dives/latest
    """
    from tools.log.info import info

    return info(recording, json=json)


@log.command
def check(recording: Path, *, json: Json = False) -> int:
    """Is everything in it that was sent? For every topic: sent, recorded, and lost where.

    RECORDING is a dive's folder or its MCAP file. `link`: lost on the link; `thinned`: left out
    because the link is slow; `queue`: too many waited for it; `refused`: the recorder could not
    read them; `recorder`: it or its disk was too slow or full; `unreported`: after the link's last
    report. Exit status 3: some are missing and nobody accounts for them, or the file is damaged,
    was recovered, or was not finished.

    Example: lindy log check dives/latest
    """
    from tools.log.check import check

    return check(recording, json=json)


@log.command
def cut(
    recording: Path,
    *,
    out: Out,
    from_: Annotated[
        float, Parameter(name="--from", help="[s] since the recording began, inclusive")
    ] = 0.0,
    to: Annotated[
        float, Parameter(show_default=False, help="[s] exclusive; default: to its end")
    ] = inf,
    dive: Annotated[
        int | None,
        Parameter(
            show_default=False,
            help="in place of --from and --to: the dive of this number, from 1, of `lindy log "
            "info`: armed to disarmed, with 5 s before and after, and nothing of another dive",
        ),
    ] = None,
    topics: Annotated[
        tuple[str, ...],
        Parameter(
            negative=(),
            consume_multiple=True,
            show_default=False,
            help="keys, or patterns such as 'sensor/*'; default: all",
        ),
    ] = (),
) -> int:
    """A part of a recording as a recording of its own, which any MCAP reader opens.

    RECORDING is a dive's folder or its MCAP file. Attached files and schemas are kept, and so are
    the seconds: a part of a part has those of the whole. Exit status 3: the recording is damaged or
    was not finished.

    Example: lindy log cut dives/latest --from 30 --to 40 --topics state 'sensor/*' --out part.mcap
             lindy log cut dives/class/rov1 --dive 2 --out dive2.mcap
    """
    from tools.log.cut import WantedPart, cut

    return cut(recording, out, WantedPart(from_, to, topics), dive)


@log.command
def scene(recordings: Annotated[tuple[Path, ...], Parameter(negative=())], /, *, out: Out) -> int:
    """The drones of several recordings in one 3-D scene, a file for rerun.

    RECORDINGS are dives' folders or MCAP files, such as those of `lindy record`. All share one time
    and one frame: where a drone does not know its position, it is drawn at (0, 0). Exit status 3:
    one is damaged or was not finished.

    Example: lindy log scene dives/class/rov1 dives/class/rov2 --out class.rrd
    """
    from tools.log.scene import scene

    return scene(recordings, out)


@log.command
def recover(recording: Path, *, out: Out) -> int:
    """Everything that can still be read in a recording that was cut off or damaged, as a new file.

    RECORDING is a dive's folder or its MCAP file, of whatever length. Exit status 1: not one
    message of it is whole.

    Example: lindy log recover broken.mcap --out mended.mcap
    """
    from tools.log.recover import recover

    return recover(recording, out)


Tables = Annotated[
    Path | None,
    Parameter(
        converter=named,
        show_default=False,
        help="the folder to write to; where it holds files already, a new one beside it; default: "
        "beside the recording",
    ),
]


@log.command
def csv(recording: Path, *, out: Tables = None) -> int:
    """Every topic as a table: one CSV file each, in a new folder.

    RECORDING is a dive's folder or its MCAP file. Times: t_s, seconds since the recording began,
    and log_ns and publish_ns, nanoseconds UTC of arrival and of the message's own stamp. Vectors
    have named columns, such as wanted.surge. Exit status 3: a message could not be read, or the
    file is damaged or was not finished.

    Example: lindy log csv dives/latest --out tables
    """
    from tools.log.csv_table import csv_table
    from tools.log.tables import write_tables

    return write_tables(recording, out, "csv", csv_table)


@log.command
def parquet(recording: Path, *, out: Tables = None) -> int:
    """The same tables as Parquet, smaller and with types. It needs pyarrow (extra `tables`).

    RECORDING is a dive's folder or its MCAP file. Exit status 3: a message could not be read, or
    the file is damaged or was not finished.

    Example: lindy log parquet dives/latest --out tables
    """
    from tools.log.parquet_table import parquet_table, require_pyarrow
    from tools.log.tables import write_tables

    require_pyarrow()
    return write_tables(recording, out, "parquet", parquet_table)


@log.command
def sticks(recording: Path, *, out: Out) -> int:
    """The sticks and requests of its pilot, as a stick log to fly again.

    RECORDING is a dive's folder or its MCAP file. A path that was followed is written beside OUT.
    Exit status 3: the recording is damaged or was not finished.

    Example: lindy log sticks dives/latest --out again.csv
             lindy simulate --pilot script:again.csv
    """
    from tools.log.sticks import sticks

    return sticks(recording, out)


@log.command
def compare(
    a: Path,
    b: Path,
    *,
    tolerance: Annotated[
        float, Parameter(help="[-] of the largest value of a field: what counts as the same")
    ] = 0.0,
    out: Annotated[
        Path | None,
        Parameter(converter=named, show_default=False, help="also draw both into this PNG"),
    ] = None,
    json: Json = False,
) -> int:
    """Which streams and fields of two recordings differ, when first and by how much.

    A and B are dives' folders or MCAP files, of one vehicle. Times are seconds since arming, or,
    where one was never armed, since the recording began. Exit status 1: they differ; 3: one is
    damaged or was not finished.

    Example: lindy log compare dives/before dives/after --out compared.png
    """
    from tools.log.compare import compare

    return compare(a, b, tolerance=tolerance, out=out, json=json)


@log.command
def jerk(
    recording: Annotated[tuple[Path, ...], Parameter(negative=())],
    *,
    out: Annotated[
        Path | None,
        Parameter(converter=named, show_default=False, help="also draw the spectra into this PNG"),
    ] = None,
) -> int:
    """The jerk that was felt in dives, beside the jerk that their references asked for.

    Each RECORDING is a dive's folder or its MCAP file. Felt: of the IMU's vertical acceleration and
    yaw rate, below 2 Hz, while armed. A vehicle that followed its reference exactly would feel the
    reference's jerk. Beside it how often thrusters started and changed their direction. Dives with
    the same sticks and other settings are drawn side by side.

    Example: lindy log jerk dives/one dives/other --out jerk.png
    """
    from tools.log.jerk import jerk

    return jerk(recording, out)


@log.command
def noise(
    recording: Path,
    *,
    json: Annotated[
        bool, Parameter(negative=(), show_default=False, help="no lines, JSON")
    ] = False,
) -> int:
    """Noise, rate and drift of the sensors, from a recording of a drone that lies still.

    RECORDING is a dive's folder or its MCAP file. Prints the lines to paste into the vehicle file.
    It uses the longest time in which the drone was neither armed nor moved, at least 20 s. To make
    a recording, start the drone's side alone, so that nobody arms it, and press Ctrl-C after a
    minute or longer.

    Example: lindy up drone --out dives/on_the_bench
             lindy log noise dives/on_the_bench
    """
    from tools.noise import noise

    return noise(recording, json=json)
