"""The one exception a user is meant to read."""


class LindyError(Exception):
    """Something the user can correct: one sentence that says what, where and what is allowed.

    Every entry point prints it to stderr without a traceback and exits with status 1.
    """


class EndedByUserError(LindyError):
    """The user has ended something before its end, as by Ctrl-C: the exit status is 130."""


class NeedsRealTimeError(LindyError):
    """Raised by the `wire` of a driver that cannot run on virtual time, when `stack.virtual`."""

    def __init__(self, who: str) -> None:
        super().__init__(
            f"{who} needs real time: use `lindy dive` or `lindy up drone`, or simulate another "
            f"stack"
        )
