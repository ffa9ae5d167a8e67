"""Where the command `lindy` begins: before anything is loaded that takes time."""

import os
import signal

INTERRUPTED = 130  # exit status


def main() -> int:
    """Load everything, and run a verb. Ctrl-C while it loads is one sentence, as it is later on."""
    waiting = signal.getsignal(signal.SIGINT) is signal.default_int_handler  # else it is ignored
    if waiting:
        signal.signal(signal.SIGINT, _leave)
    from tools.__main__ import main as run

    if waiting:
        signal.signal(signal.SIGINT, signal.default_int_handler)
    return run()


def _leave(*_: object) -> None:
    """Nothing has begun that must be ended, and an exception could be raised in the middle of any
    module that is being loaded."""
    os.write(2, b"lindy: interrupted\n")
    os._exit(INTERRUPTED)
