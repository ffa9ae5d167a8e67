"""`lindy up drone --resume DIR`: what the estimator had learnt before the computer went down.

Under water nothing of it can be learnt again: the atmosphere would be measured too high, the
gyroscope's bias while the vehicle moves. Only the estimator's checkpoint is taken over. That of
`reference` says whether the drone was armed, and no power cut may arm it.
"""

from pathlib import Path

import msgspec

from messages.identity import SideIdentity
from messages.payload import UNDECODABLE
from services.estimation.checkpoint import EstimationCheckpoint
from services.runtime.config.errors import LindyError
from services.runtime.launch.process_plan import CHECKPOINTS
from tools.onboard.this_start import NOTE, other_vehicle, read

ESTIMATION = "estimation"
LONGEST_S = 1800.0  # [s] by then the air pressure, the bias and the heading may have changed


def resumed(dive: Path, identity: SideIdentity, clock_ns: int, utc_s: float) -> dict[str, bytes]:
    """The checkpoints with which the services of a new start begin, by service.

    Args:
        dive: folder of the dive that broke off.
        identity: of the side that is started now.
        clock_ns: [ns] the vehicle's clock now, which has begun anew with the computer.
        utc_s: [s] now, as the file system counts; the only clock that both starts share.

    Raises:
        LindyError: there is no checkpoint, it cannot be read, it is too old, or of another vehicle.
    """
    path = newest(dive)
    try:
        data, written_s = path.read_bytes(), path.stat().st_mtime
    except OSError as error:
        raise LindyError(f"--resume: cannot read {path}: {error.strerror}") from None
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
            f"to {LONGEST_S:.0f} s; start without --resume, with the vehicle afloat and at rest"
        )
    if why := other_vehicle(read(path.parent / f"{NOTE}.json"), identity):
        raise LindyError(
            f"--resume: what was learnt in {path} is not taken over: {why}; start with the vehicle "
            f"of that dive, or without --resume, with the vehicle afloat and at rest"
        )
    then_ns = clock_ns - round(age_s * 1e9)
    return {ESTIMATION: msgspec.json.encode(msgspec.structs.replace(checkpoint, stamp_ns=then_ns))}


def newest(dive: Path) -> Path:
    """The estimator's newest checkpoint in the folder of a dive.

    Raises:
        LindyError: there is none.
    """
    found = list(dive.glob(f"{CHECKPOINTS}*/{ESTIMATION}.json"))
    if not found:
        raise LindyError(
            f"--resume: there is no {CHECKPOINTS}/{ESTIMATION}.json in {dive}; expected the folder "
            f"of a dive in which the drone had calibrated"
        )
    return max(found, key=lambda path: path.stat().st_mtime)
