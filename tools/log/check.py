"""`lindy log check`: is everything in a recording that was sent, and if not, who knows why?"""

from pathlib import Path

import msgspec

from messages.text import harmless
from services.runtime.config.errors import LindyError
from tools.choices import Json
from tools.log.account import Account, Accounts, accounts
from tools.log.text_table import table
from tools.recordings.progress import reading
from tools.recordings.recording import Recording, open_recording

SOUND, NOT_SOUND = 0, 3  # exit statuses
COLUMNS = ("link", "thinned", "queue", "refused", "recorder", "unreported", "missing", "duplicated")


def check(recording: Path, *, json: Json = False) -> int:
    """Is everything in it that was sent, and what was lost where?

    RECORDING is a dive's folder or its MCAP file. For every topic: sent, recorded, and lost.
    `link`: lost on the link; `thinned`: left out because the link is slow; `queue`: too many waited
    for it; `refused`: the recorder could not read them; `recorder`: it or its disk was too slow or
    full; `unreported`: after the link's last report. Exit status 3: some are missing and nobody
    accounts for them, or the file is damaged, was recovered, or was not finished.

    Example: lindy log check dives/latest
    """
    opened = open_recording(recording)
    if not opened.metadata("dive"):
        opened.require_messages()
        raise LindyError(
            f"{recording} was not recorded by Lindy: what its numbers mean is not known"
        )
    with reading("checking", opened.size) as opened.advance:
        found = accounts(opened)
    if not found.topics:
        raise opened.empty(recording)
    wrong = [*incomplete(opened), *in_words(found)]
    wrong += [] if wrong else found.unrecorded
    if json:
        whole = {"ok": not wrong, "wrong": wrong, **msgspec.to_builtins(found)}
        print(msgspec.json.format(msgspec.json.encode(whole)).decode())
    else:
        print(harmless(as_text(found)))
        print(harmless("\n".join(wrong or ["everything that was sent is accounted for"])))
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
        f"{key}: {account.missing} of {account.sent} messages are missing, and no service "
        "counted a loss, as when the recorder was down"
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
