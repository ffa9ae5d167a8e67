"""A dive that broke off on this start of the computer: the supervisor was killed, or hung, or had a
mistake in it, and whoever started it (systemd) starts it again. The vehicle may be under water,
where nothing can be calibrated, so the new dive goes on with what the estimator had learnt.

After a power cut the clock has begun anew, and the vehicle may have been moved: then a person
decides (`--resume`).
"""

from pathlib import Path
from typing import NamedTuple

import msgspec

from messages.payload import UNDECODABLE
from services.estimation.checkpoint import EstimationCheckpoint
from services.runtime.config.running import running_in
from services.runtime.launch.process_plan import CHECKPOINTS
from tools.live.resume import ESTIMATION, LONGEST_S
from tools.onboard.this_start import NOTE, StartNote, read


class BrokenOff(NamedTuple):
    """A dive to go on with, if its vehicle is the one that is started now."""

    folder: Path
    start: StartNote  # says which vehicle it was
    age_s: float  # [s] of what the estimator had learnt
    checkpoint: bytes


def broken_off(dives: Path, boot: str, vehicle: str, now: int) -> BrokenOff | None:
    """The newest dive of this drone and this start of the computer, if it broke off and what the
    estimator had learnt is not too old.

    Args:
        dives: folder with the folders of dives.
        boot: id of this start of the computer.
        vehicle: name of the drone on the network.
        now: [ns] of the clock that began with the computer.
    """
    found = [
        (start.began_ns, path.parent, start)
        for path in dives.glob(f"*/{CHECKPOINTS}*/{NOTE}.json")
        if (start := read(path)) is not None and (start.boot_id, start.vehicle) == (boot, vehicle)
    ]
    if not found:
        return None
    _, checkpoints, start = max(found, key=lambda one: one[0])
    folder, learnt = checkpoints.parent, _learnt(checkpoints)
    if start.ended or learnt is None or running_in(folder) is not None:
        return None
    age_s = (now - learnt.stamp_ns) / 1e9
    if not 0.0 <= age_s <= LONGEST_S:
        return None
    return BrokenOff(folder, start, age_s, msgspec.json.encode(learnt))


def _learnt(checkpoints: Path) -> EstimationCheckpoint | None:
    try:
        data = (checkpoints / f"{ESTIMATION}.json").read_bytes()
        return msgspec.json.decode(data, type=EstimationCheckpoint)
    except (OSError, *UNDECODABLE):
        return None
