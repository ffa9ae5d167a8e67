"""What operating systems do not have in common: chosen here, and nowhere else.

`posix` is for Linux and macOS, `portable` for Windows. Both have the same names, and one test is
for both. The lowest room of the runtime. The tools and what is in an io/ import it, too.
"""

import sys

if sys.platform == "win32":
    from services.runtime.os import portable as system
else:
    from services.runtime.os import posix as system

__all__ = ["system"]
