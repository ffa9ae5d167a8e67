"""The one exception a user is meant to read."""


class LindyError(Exception):
    """Something the user can mend: one sentence that says what, where and what is allowed.

    Every entry point prints it to stderr without a traceback and exits with status 1.
    """
