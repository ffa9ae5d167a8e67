"""What this side says of itself: version, messages, vehicle."""

import hashlib
import json
import re
from collections.abc import Sequence
from functools import cache
from pathlib import Path
from typing import Any

import msgspec

from messages import topics
from messages.identity import SideIdentity
from messages.topic import AnyTopic
from messages.version import VERSION
from services.runtime.config.stack import BODY, Stack

ROOT = Path(__file__).resolve().parents[3]
LETTERS = 12  # of a hash: for people to compare, not against anybody
IN_WORDS = ("title", "description")  # of a JSON schema; they change nothing


def identity_of(stack: Stack, side: str, instance: int) -> SideIdentity:
    """As this process has read the vehicle file.

    Raises:
        LindyError: the vehicle file cannot be read.
    """
    return SideIdentity(
        side=side,
        instance=instance,
        version=VERSION,
        # On virtual time a dive is the same bytes whatever it was committed as.
        commit="" if stack.virtual else commit_here(),
        messages=messages_hash(topics.ALL),
        vehicle=stack.vehicle_name,
        vehicle_hash=_hash(stack.section(BODY, dict[str, Any])),
    )


def identity_now(stack: Stack, side: str) -> SideIdentity:
    """Of a side that is started now: the vehicle file may have changed since it was read.

    Raises:
        LindyError: the vehicle file cannot be read.
    """
    return msgspec.structs.replace(
        identity_of(stack, side, 0), vehicle_hash=_hash(stack.body_now())
    )


@cache
def messages_hash(rows: Sequence[AnyTopic]) -> str:
    """Of the topic table and everything its messages consist of, but not of what is said about
    them."""
    kinds = sorted({row.message for row in rows}, key=lambda kind: kind.__name__)
    _, parts = msgspec.json.schema_components(kinds)
    table = [[r.key, r.message.__name__, r.hz, r.qos.value, r.way.value] for r in rows]
    return _hash({"table": table, "parts": _without_words(parts)})


def _without_words(part: Any) -> Any:
    if isinstance(part, dict):
        return {
            key: _without_words(value)
            for key, value in part.items()  # pyright: ignore[reportUnknownVariableType]
            if not (key in IN_WORDS and isinstance(value, str))
        }
    return [_without_words(each) for each in part] if isinstance(part, list) else part  # pyright: ignore[reportUnknownVariableType]


def _hash(tree: Any) -> str:
    text = json.dumps(tree, sort_keys=True, default=str)
    return hashlib.sha256(text.encode()).hexdigest()[:LETTERS]


def commit_here() -> str:
    """Of the repository that Lindy runs from; empty: installed."""
    return _commit(ROOT / ".git")


@cache
def _commit(git: Path) -> str:
    """What a repository has checked out; empty where there is none, or none that is understood."""
    try:
        if git.is_file():  # a worktree: it says where its folder is
            git = Path(git.read_text(encoding="utf-8").removeprefix("gitdir:").strip())
        head = (git / "HEAD").read_text(encoding="utf-8").strip()
        name = head.removeprefix("ref:").strip()
        if name != head:
            shared = git / "commondir"
            common = git / shared.read_text(encoding="utf-8").strip() if shared.is_file() else git
            head = _of_branch(common, name)
    except (OSError, ValueError):
        return ""
    return head[:LETTERS] if re.fullmatch(r"[0-9a-f]{40,64}", head) else ""


def _of_branch(git: Path, name: str) -> str:
    if (loose := git / name).is_file():
        return loose.read_text(encoding="utf-8").strip()
    for line in (git / "packed-refs").read_text(encoding="utf-8").splitlines():
        commit, _, packed = line.partition(" ")
        if packed == name:
            return commit
    return ""
