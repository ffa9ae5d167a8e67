"""The notes of a release: what the changelog says of it, or of what is unreleased."""

import re
import sys
from pathlib import Path

CHANGELOG = Path(__file__).parents[2] / "CHANGELOG.md"


def notes(changelog: str, version: str) -> str:
    """The part of a version; of what is unreleased, where that has no part yet.

    Raises:
        ValueError: there is neither.
    """
    parts = dict(re.findall(r"^## ([^\s\n]+)[^\n]*\n(.*?)(?=^## |\Z)", changelog, re.M | re.S))
    for title in (version, f"[{version}]", "Unreleased"):
        if title in parts:
            return f"# Lindy {version}\n\n{parts[title].strip()}\n"
    raise ValueError(f"{CHANGELOG} says nothing of {version}")


if __name__ == "__main__":
    sys.stdout.write(notes(CHANGELOG.read_text(encoding="utf-8"), sys.argv[1]))
