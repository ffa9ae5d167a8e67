"""The command `lindy`, also as `python -m lindy`."""

import gc
import sys

from services.runtime.os import RARE_SEARCHES


def main() -> int:
    """Run the verb of the command line. Returns the exit status."""
    gc.set_threshold(*RARE_SEARCHES)  # before the imports
    from tools.__main__ import main as run

    try:
        return run()
    finally:
        gc.freeze()  # nothing is searched at the end


if __name__ == "__main__":
    sys.exit(main())
