"""Rare garbage collection. A service makes thousands of short-lived messages a second and no
reference cycles; searching for cycles would cost an eighth of its CPU time."""

import gc
from collections.abc import Generator
from contextlib import contextmanager

ALLOCATIONS = 20_000  # between two searches; Python's default is 700


@contextmanager
def rare_collections() -> Generator[None]:
    """Enter after everything is set up: existing objects are not searched until the end."""
    before = gc.get_threshold()
    gc.freeze()
    gc.set_threshold(ALLOCATIONS, 20, 50)
    try:
        yield
    finally:
        gc.set_threshold(*before)
        gc.unfreeze()
