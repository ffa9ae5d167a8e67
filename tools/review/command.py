"""The verb `lindy review`."""

import sys
from contextlib import redirect_stdout
from pathlib import Path
from typing import Annotated

import msgspec
from cyclopts import Parameter

from messages.text import harmless
from services.runtime.config.errors import LindyError
from tools.choices import Json, Overrides, named
from tools.exit_status import DONE, LOST
from tools.fresh import free_name, refuse_existing, write_fresh
from tools.importing.command import import_log
from tools.importing.rosbag_file import is_rosbag
from tools.packages import require_package
from tools.recordings.recording import open_recording
from tools.review.review import page
from tools.review.review import review as reviewed

RECORDING = ".mcap"


def review(
    file: Annotated[
        Path,
        Parameter(
            converter=named,
            help="a dive's folder or its MCAP file, or a log that `lindy import` reads",
        ),
    ],
    *,
    out: Annotated[
        Path | None,
        Parameter(
            converter=named,
            help="the page to write, a new file; default: review.html beside the recording, or "
            "the next free name",
        ),
    ] = None,
    map_: Annotated[
        str | None, Parameter(name="--map", help="of `lindy import`, for a log of another program")
    ] = None,
    vehicle: Annotated[
        str | None, Parameter(help="of `lindy import`, for a log of another program")
    ] = None,
    quick: Annotated[
        bool,
        Parameter(
            negative="",
            help="without identifying the vehicle and flying its stops again, which takes longest",
        ),
    ] = False,
    set_: Overrides = (),
    json: Json = False,
) -> int:
    """Review a dive of any vehicle: one page with plots.

    What the recording holds, vibration, Lindy's estimation beside the vehicle's own, every stop,
    and what was rejected. A log of another program is imported first, into a new folder beside it.
    With --json the same figures are printed, and no page is written unless --out names one. Exit
    status 3: the recording is damaged or not whole, and this is of what can be read.

    Example: lindy review 00000042.BIN
             lindy review dives/latest --out yesterday.html
    """
    writes = out is not None or not json
    if writes:
        require_package("matplotlib", "figures", "the page")
    if out is not None:
        if out.suffix != ".html":
            raise LindyError(f"--out {out}: expected a name that ends in .html")
        refuse_existing(out)
    recording = _recording(file, map_, vehicle)
    found = reviewed(recording, tuple(set_), quick=quick)
    if writes:
        folder = recording if recording.is_dir() else recording.parent
        place = out or free_name(folder, "review", ".html")
        write_fresh(place, page(found).encode())
        print(harmless(f"written {place}"), file=sys.stderr if json else sys.stdout, flush=True)
    if json:
        print(msgspec.json.format(msgspec.json.encode(found.figures), indent=1).decode())
    else:
        print(harmless("\n".join([*found.figures.remarks, *found.short])), flush=True)
    return LOST if found.source.recording.damage else DONE


def _recording(file: Path, map_: str | None, vehicle: str | None) -> Path:
    """The recording to review: this one, or a new one of a log of another program.

    Raises:
        LindyError: it cannot be imported, or options of the import are given for a recording.
    """
    if _is_ours(file):
        for option, value in (("--map", map_), ("--vehicle", vehicle)):
            if value is not None:
                raise LindyError(
                    f"{option} {value}: {file} is a recording already; {option} is for a log of "
                    f"another program"
                )
        return file
    if not file.exists():
        raise LindyError(f"there is no file {file}")
    folder = free_name(file.parent, f"{file.stem}-lindy")  # beside it
    with redirect_stdout(sys.stderr):  # --json prints figures only
        import_log(file, map_=map_, out=folder, vehicle=vehicle)
    return folder


def _is_ours(file: Path) -> bool:
    """A dive's folder, or a file that says of which dive it is.

    Raises:
        LindyError: an MCAP file that cannot be read.
    """
    if file.is_dir():
        return not is_rosbag(file)
    if file.suffix.lower() != RECORDING:
        return False
    return bool(open_recording(file).metadata("dive"))
