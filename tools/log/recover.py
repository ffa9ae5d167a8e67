"""`lindy log recover`: a recording that was cut off or damaged, as a whole file."""

from pathlib import Path
from typing import NamedTuple

from mcap.records import Metadata

from messages.text import harmless
from services.runtime.config.errors import LindyError
from tools.choices import NewFile
from tools.fresh import refuse_existing
from tools.recordings.mcap_copy import new_mcap
from tools.recordings.mcap_records import HASH, MENDED_BY, Damage, records
from tools.recordings.progress import reading
from tools.recordings.recording import open_recording


class Recovered(NamedTuple):
    messages: int
    attachments: int
    wrong: list[str]  # what was wrong with the files; empty: nothing was missing


def recover(recording: Path, *, out: NewFile) -> int:
    """Save what can be read of a damaged recording.

    RECORDING is a dive's folder or its MCAP file, of whatever length, cut off or damaged. All that
    can still be read is written as a new file. Exit status 1: neither a
    message nor an attached file of it is whole.

    Example: lindy log recover broken.mcap --out mended.mcap
    """
    refuse_existing(out)
    found = recovered(recording, out)
    files = f" and {found.attachments} attached files" if found.attachments else ""
    wrong = "; ".join(found.wrong) or "nothing was missing"
    print(harmless(f"{found.messages} messages{files} written to {out}: {wrong}"), flush=True)
    return 0


def recovered(path: Path, out: Path) -> Recovered:
    """
    Raises:
        LindyError: nothing can be read, or the file cannot be written.
    """
    recording = open_recording(path)
    before, wrong = 0, list[str]()
    with reading("recovering", recording.size) as advance, new_mcap(out) as copy:
        for file in recording.files:
            copy.next_file()
            damage = Damage()
            for record in records(file, damage=damage, at=lambda at, n=before: advance(n + at)):
                if not (isinstance(record, Metadata) and record.name == HASH):
                    copy.add(record)
            wrong += [said.removesuffix(f"; {MENDED_BY}") for said in damage.in_words(file.name)]
            before += file.stat().st_size
        if copy.is_empty and not copy.attachments:
            raise LindyError(f"nothing can be recovered from {path}: no message in it is whole")
        if copy.orphans:
            wrong.append(f"{copy.orphans} messages of unknown topics are left out")
        about = {file.name: str(file.stat().st_size) for file in recording.files}
        copy.metadata(Metadata("recovered", about | {"found": "; ".join(wrong)}))
    return Recovered(copy.messages, copy.attachments, wrong)
