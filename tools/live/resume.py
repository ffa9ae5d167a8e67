"""What the estimator had learnt in a dive that did not end, and a new start goes on with.

Under water nothing of it can be learnt again: the atmosphere would be measured too high, the
gyroscope's bias while the vehicle moves. Only the estimator's checkpoint is taken over: that of
`reference` says whether the drone was armed, and no start may arm it.

A dive breaks off when its supervisor is killed, hangs or has a mistake in it; then whoever started
it (systemd) starts it again, and it goes on by itself. After a power cut the clock has begun anew
and the vehicle may have been moved: then a person decides (`lindy up drone --resume DIR`).
"""

import time
from pathlib import Path
from typing import NamedTuple, TypeVar

import msgspec

from messages.identity import SideIdentity
from messages.payload import UNDECODABLE
from services.estimation.checkpoint import EstimationCheckpoint
from services.runtime.config.errors import LindyError
from services.runtime.config.identity import identity_of
from services.runtime.config.running import running_in
from services.runtime.config.stack import Stack
from services.runtime.launch.process_plan import CHECKPOINTS
from services.runtime.node.checkpoint import write_safely

S = TypeVar("S")
ESTIMATION = "estimation"
NOTE = "this-start"  # a file beside the checkpoints; no service has a name with a hyphen
BOOT_ID = Path("/proc/sys/kernel/random/boot_id")  # Linux only
LONGEST_S = 1800.0  # [s] by then the air pressure, the bias and the heading may have changed
ANEW = "with the vehicle afloat and at rest"


class StartNote(msgspec.Struct, frozen=True):
    """On which start of the computer a dive began, with which vehicle, and whether it was ended
    because somebody wanted it."""

    boot_id: str  # of the computer's start; empty: not Linux
    vehicle: str  # name of the drone on the network
    began_ns: int  # [ns] of the clock that began with the computer
    ended: bool = False  # deliberately; else the dive broke off, or goes on
    vehicle_file: str = ""  # its name; empty: an older Lindy wrote this note
    vehicle_hash: str = ""  # of the table [vehicle] of that file, with what --set changed


class BrokenOff(NamedTuple):
    """A dive to go on with, if its vehicle is the one that is started now."""

    folder: Path
    start: StartNote  # says which vehicle it was
    age_s: float  # [s] of what the estimator had learnt
    checkpoint: bytes


def begin_with(stack: Stack, resume: Path | None = None) -> dict[str, bytes]:
    """The files that the folder of the checkpoints begins with: a note of this start, and the
    estimator's checkpoint of the dive that the user names, or of one that broke off, which is
    announced.

    Raises:
        LindyError: the vehicle file cannot be read, or the dive cannot be resumed.
    """
    boot, now, identity = boot_id(), time.monotonic_ns(), identity_of(stack, "drone", 0)
    note = StartNote(
        boot_id=boot or "",
        vehicle=stack.drone_name,
        began_ns=now,
        vehicle_file=identity.vehicle,
        vehicle_hash=identity.vehicle_hash,
    )
    start = {NOTE: msgspec.json.encode(note)}
    if resume is not None:
        return {**start, ESTIMATION: resumed(resume, identity, now, time.time())}
    before = None
    if boot is not None:
        before = broken_off(stack.out_dir.parent, boot, stack.drone_name, now)
    if before is None:
        return start
    which = f"the calibration of {before.folder}, which broke off"
    if why := other_vehicle(before.start, identity):
        print(f"does not go on with {which}: {why}; calibrates anew, {ANEW}", flush=True)
        return start
    print(f"goes on with {which}; it is {before.age_s:.0f} s old", flush=True)
    return {**start, ESTIMATION: before.checkpoint}


def resumed(dive: Path, identity: SideIdentity, clock_ns: int, utc_s: float) -> bytes:
    """The estimator's checkpoint, by the clock of this start.

    Args:
        dive: folder of the dive that broke off.
        identity: of the side that is started now.
        clock_ns: [ns] the vehicle's clock now, which has begun anew with the computer.
        utc_s: [s] now, as the file system counts; the only clock that both starts share.

    Raises:
        LindyError: there is no checkpoint, it cannot be read, it is too old, or of another vehicle.
    """
    try:
        found = [(p.stat().st_mtime, p) for p in dive.glob(f"{CHECKPOINTS}*/{ESTIMATION}.json")]
        written_s, path = max(found, default=(0.0, dive))
        data = path.read_bytes() if found else b""
    except OSError as error:
        raise LindyError(f"--resume: cannot read {dive}: {error.strerror}") from None
    if not found:
        raise LindyError(
            f"--resume: there is no {CHECKPOINTS}/{ESTIMATION}.json in {dive}; expected the folder "
            f"of a dive in which the drone had calibrated"
        )
    try:
        checkpoint = msgspec.json.decode(data, type=EstimationCheckpoint)
    except UNDECODABLE as error:
        raise LindyError(
            f"--resume: {path} is not a checkpoint of the estimator: {error}"
        ) from None
    age_s = utc_s - written_s
    if not 0.0 <= age_s <= LONGEST_S:
        raise LindyError(
            f"--resume: {path} was written {age_s:.0f} s ago by this computer's clock, expected 0 "
            f"to {LONGEST_S:.0f} s; start without --resume, {ANEW}"
        )
    if why := other_vehicle(read(path.parent / f"{NOTE}.json"), identity):
        raise LindyError(
            f"--resume: what was learnt in {path} is not taken over: {why}; start with the vehicle "
            f"of that dive, or without --resume, {ANEW}"
        )
    then_ns = clock_ns - round(age_s * 1e9)
    return msgspec.json.encode(msgspec.structs.replace(checkpoint, stamp_ns=then_ns))


def broken_off(dives: Path, boot: str, vehicle: str, now: int) -> BrokenOff | None:
    """Of this drone and this start of the computer, the dive that was alive last, if it broke off
    and what the estimator had learnt is not too old.

    Args:
        dives: folder with the folders of dives.
        boot: id of this start of the computer.
        vehicle: name of the drone on the network.
        now: [ns] of the clock that began with the computer.
    """
    found = [
        (path.parent, start, _decoded(path.with_name(f"{ESTIMATION}.json"), EstimationCheckpoint))
        for path in dives.glob(f"*/{CHECKPOINTS}*/{NOTE}.json")
        if (start := read(path)) is not None and (start.boot_id, start.vehicle) == (boot, vehicle)
    ]
    if not found:
        return None
    checkpoints, start, learnt = max(
        found, key=lambda one: (_alive_ns(one[1], one[2]), one[1].began_ns)
    )
    if learnt is None or start.ended or running_in(checkpoints.parent) is not None:
        return None
    age_s = (now - learnt.stamp_ns) / 1e9
    if not 0.0 <= age_s <= LONGEST_S:
        return None
    return BrokenOff(checkpoints.parent, start, age_s, msgspec.json.encode(learnt))


def _alive_ns(start: StartNote, learnt: EstimationCheckpoint | None) -> int:
    """[ns] When a dive was alive last, as far as is known."""
    return start.began_ns if learnt is None else max(start.began_ns, learnt.stamp_ns)


def boot_id() -> str | None:
    """Of this start of the computer; None: not Linux."""
    try:
        return BOOT_ID.read_text(encoding="utf-8").strip()
    except OSError:
        return None


def read(path: Path) -> StartNote | None:
    """None: there is no such note, or not a whole one."""
    return _decoded(path, StartNote)


def _decoded(path: Path, kind: type[S]) -> S | None:
    try:
        return msgspec.json.decode(path.read_bytes(), type=kind)
    except (OSError, *UNDECODABLE):
        return None


def other_vehicle(then: StartNote | None, now: SideIdentity) -> str:
    """Why what was learnt then is not of the vehicle that is started now; empty: it is.

    Args:
        then: the note beside what was learnt; None: there is none.
    """
    if then is None or not then.vehicle_hash:
        return "nothing beside it says with which vehicle it was measured"
    if then.vehicle_hash != now.vehicle_hash:
        return (
            f"it was measured with the vehicle {then.vehicle_file}, and the table [vehicle] of "
            f"{now.vehicle} differs, or a --set"
        )
    return ""


def mark_ended(checkpoints: Path) -> None:
    """The dive with these checkpoints was ended deliberately.

    Raises:
        OSError: the disk failed.
    """
    path = checkpoints / f"{NOTE}.json"
    if (start := read(path)) is not None:
        write_safely(path, msgspec.json.encode(msgspec.structs.replace(start, ended=True)))
