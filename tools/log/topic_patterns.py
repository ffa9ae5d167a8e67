"""`--topics` of the verbs that take a part of a recording."""

from collections.abc import Iterable, Sequence
from fnmatch import fnmatchcase
from pathlib import Path
from typing import Annotated

from cyclopts import Parameter

from services.runtime.config.errors import LindyError
from services.runtime.config.settings import nearest

Topics = Annotated[
    tuple[str, ...],
    Parameter(
        consume_multiple=True,
        help="keys, or patterns such as 'sensor/*', with blanks between; default: all",
    ),
]


def is_chosen(key: str, patterns: Sequence[str]) -> bool:
    return not patterns or any(fnmatchcase(key, pattern) for pattern in patterns)


def require_known(patterns: Iterable[str], keys: Iterable[str], file: Path) -> None:
    """
    Raises:
        LindyError: no topic of the file is one of these.
    """
    there = sorted(keys)
    for pattern in patterns:
        if not any(fnmatchcase(key, pattern) for key in there):
            raise LindyError(
                f"--topics: no topic of {file} is {pattern!r}{nearest(pattern, there)}"
            )
