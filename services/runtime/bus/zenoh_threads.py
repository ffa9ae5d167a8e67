"""Zenoh's threads in a process of this stack: one instead of up to nine.

By itself Zenoh starts five pools of threads, and every message passes through three of them. With
some hundred small messages a second, the switches between the threads cost more than the messages.
With one thread, that thread also empties the queues of what is to be sent; so they must hold what
is published in one go: 16 batches of 64 kB, the most that Zenoh allows, so 1 MB per priority. What
is published beyond that before the thread is free again is dropped: also a small message right
behind 1 MB. Messages of 300 kB leave room for others.
"""

import ctypes
import os
import threading

VARIABLE = "ZENOH_RUNTIME"  # Zenoh reads it when the first session of a process is opened
ONE_THREAD = (
    "(rx: (worker_threads: 1), tx: (handover: rx), acc: (handover: rx), "
    "net: (handover: rx), app: (handover: rx))"
)
BATCHES = 16  # of each priority, on each link
PRIORITIES = (
    "control", "real_time", "interactive_high", "interactive_low", "data_high", "data", "data_low",
    "background",
)  # fmt: skip
QUEUES = dict.fromkeys(PRIORITIES, BATCHES)  # Zenoh's `transport/link/tx/queue/size`

_kept = threading.local()


def use_one_thread() -> None:
    """Call before the first session is opened. What the user's environment says wins."""
    if not os.environ.get(VARIABLE):
        os.environ[VARIABLE] = ONE_THREAD


def keep_thread_state() -> None:
    """Keep Python's state of this thread of Zenoh's for as long as the thread lives; otherwise each
    call of a subscriber makes one, with a stack of its own, and throws it away."""
    if not hasattr(_kept, "state"):
        _kept.state = ctypes.pythonapi.PyGILState_Ensure()  # never released
