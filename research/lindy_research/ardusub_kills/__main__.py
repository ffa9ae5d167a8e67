"""python -m lindy_research.ardusub_kills (prints a table of what the board does)"""

import argparse
import os
import sys
from pathlib import Path
from tempfile import TemporaryDirectory

from lindy_research.ardusub_kills.dive import SERVICES, kill_in_a_dive


def main() -> int:
    parser = argparse.ArgumentParser(prog="python -m lindy_research.ardusub_kills")
    parser.add_argument("services", nargs="*", help="all without any")
    said = parser.parse_args()
    for service in said.services:
        if service not in SERVICES:
            parser.error(f"services: found {service!r}; allowed: {', '.join(SERVICES)}")
    path = os.environ.get("LINDY_ARDUSUB", "").partition(":")[0]
    if not path:
        print("LINDY_ARDUSUB names no firmware; docs/ardusub.md says what it is", file=sys.stderr)
        return 2
    print("| killed | stick's thrust gone | all outputs neutral | the board said |")
    print("|---|---|---|---|")
    for service in said.services or SERVICES:
        with TemporaryDirectory() as folder:
            found = kill_in_a_dive(path, service, Path(folder) / "dive")
        times = [_seconds(found.stick_gone), _seconds(found.neutral)]
        print(
            "|",
            " | ".join([f"`{service}`", *times, ", ".join(found.texts) or "-"]),
            "|",
            flush=True,
        )
    return 0


def _seconds(after: float | None) -> str:
    return "not within 3 s" if after is None else f"{after:.2f} s"


if __name__ == "__main__":
    sys.exit(main())
