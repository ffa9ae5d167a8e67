"""Python's search for reference cycles, made rare. A service makes thousands of short-lived
messages a second and no cycles; looking for some among them costs an eighth of its time."""

import gc
from collections.abc import Generator
from contextlib import contextmanager

ALLOCATIONS = 20_000  # between two searches; Python's default is 700


@contextmanager
def rare_collections() -> Generator[None]:
    """Enter once everything is set up: what exists then is not looked at until the end."""
    before = gc.get_threshold()
    gc.freeze()
    gc.set_threshold(ALLOCATIONS, 20, 50)
    try:
        yield
    finally:
        gc.set_threshold(*before)
        gc.unfreeze()
