"""What operating systems do not have in common: chosen here, and nowhere else.

`posix` is for Linux and macOS, `portable` for Windows. Both have the same names, and one test is
for both. The lowest room of the runtime. The tools and what is in an io/ import it, too.
"""

import sys
from typing import Protocol

if sys.platform == "win32":
    from services.runtime.os import portable as system
else:
    from services.runtime.os import posix as system

__all__ = ["Lock", "system"]


class Lock(Protocol):
    """Of a file or a folder; ends with the process, if not before."""

    def release(self) -> None: ...

    def hand_over(self) -> int | None:
        """Its descriptor, for the program that this one becomes; None: it has none."""
        ...
