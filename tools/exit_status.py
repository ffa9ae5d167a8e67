"""Exit statuses of `lindy`, for people in docs/commands.md."""

DONE = 0
ERROR = 1  # not done, and one sentence on stderr says why; or the answer is no
LOST = 3  # done, but data was lost, or a service did not work for a while
INTERRUPTED = 130  # Ctrl-C, as of any program
UNREAD = 141  # nobody reads the output any more; that of a program that SIGPIPE ends
