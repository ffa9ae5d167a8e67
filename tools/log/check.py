"""`lindy log check`: is everything in a recording that was sent, and if not, who knows why?"""

from pathlib import Path

import msgspec

from services.runtime.config.errors import LindyError
from tools.log.account import Account, Accounts, accounts
from tools.log.text_table import table
from tools.recordings.progress import reading
from tools.recordings.recording import Recording, open_recording

SOUND, NOT_SOUND = 0, 3  # exit statuses
COLUMNS = ("link", "thinned", "queue", "refused", "recorder", "unreported", "missing", "duplicated")


def check(path: Path, *, json: bool = False) -> int:
    """Print where every message is. Returns the exit status: 3 when some are missing and nobody
    accounts for them, or the recording is damaged or was not finished.

    Raises:
        LindyError: there is no recording, or none of Lindy's.
    """
    recording = open_recording(path)
    if not recording.metadata("dive"):
        raise LindyError(f"{path} was not recorded by Lindy: what its numbers mean is not known")
    with reading("checking", recording.size) as recording.advance:
        found = accounts(recording)
    if not found.topics:
        raise LindyError(f"{path} holds no messages")
    wrong = [*incomplete(recording), *in_words(found)]
    if json:
        whole = {"ok": not wrong, "wrong": wrong, **msgspec.to_builtins(found)}
        print(msgspec.json.format(msgspec.json.encode(whole)).decode())
    else:
        print(as_text(found))
        print("\n".join(wrong or ["everything that was sent is accounted for"]))
    return NOT_SOUND if wrong else SOUND


def incomplete(recording: Recording) -> list[str]:
    """Why a recording that was read may have had more."""
    found = recording.damage
    if recording.metadata("recovered").get("found"):
        found.append(f"it was recovered: {recording.metadata('recovered')['found']}")
    return found


def in_words(found: Accounts) -> list[str]:
    """What is wrong."""
    return [
        f"{key}: {account.missing} of {account.sent} messages are missing, and nobody lost them"
        for key, account in found.topics.items()
        if account.missing
    ]


def as_text(found: Accounts) -> str:
    """A table, with the columns that are not empty."""
    shown = [name for name in COLUMNS if any(getattr(a, name) for a in found.topics.values())]
    heads = ["topic", "sent", "recorded", *shown]
    rows = [
        [key, str(account.sent), str(account.recorded), *(_cell(account, name) for name in shown)]
        for key, account in found.topics.items()
    ]
    total = [sum(getattr(a, name) for a in found.topics.values()) for name in heads[1:]]
    rows.append(["all", *map(str, total)])
    lines = [table(heads, rows)]
    if found.backwards:
        times = "once" if found.backwards == 1 else f"{found.backwards} times"
        lines.append(f"the recorder's clock ran backwards {times}")
    return "\n".join(lines)


def _cell(account: Account, name: str) -> str:
    return str(getattr(account, name) or "")
