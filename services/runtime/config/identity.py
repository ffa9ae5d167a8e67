"""What this side says of itself: version, messages, vehicle."""

import hashlib
import json
import subprocess
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
GIT_S = 2.0  # [s] for git to answer
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


@cache
def commit_here() -> str:
    """Of the repository that Lindy runs from; empty: installed, or there is no git here."""
    if not (ROOT / ".git").exists():
        return ""
    asked = ["git", "-C", str(ROOT), "rev-parse", "HEAD"]
    try:
        answer = subprocess.run(asked, capture_output=True, text=True, timeout=GIT_S, check=True)
    except (OSError, subprocess.SubprocessError):
        return ""
    return answer.stdout[:LETTERS]
