"""The command `lindy`, also as `python -m lindy`."""

import sys

from tools.__main__ import main

if __name__ == "__main__":
    sys.exit(main())
