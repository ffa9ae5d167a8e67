"""Waiting for what another process or thread does, and nothing announces."""

import linecache
import time
from collections.abc import Callable
from types import FunctionType
from typing import TypeVar

PATIENCE_S = 120.0  # [s] never reached unless something is broken, on a slow and busy computer
LOOK_S = 0.005  # [s] between two looks

Happened = TypeVar("Happened")


def until(
    happens: Callable[[], Happened | None],
    what: Callable[[], object] | None = None,
    meanwhile: Callable[[], object] | None = None,
) -> Happened:
    """Wait for something to be true, and return it.

    Args:
        what: shown if it does not happen, as it is then.
        meanwhile: called after each look in vain.
    """
    deadline = time.monotonic() + PATIENCE_S
    while not (happened := happens()):
        if time.monotonic() > deadline:
            shown = "" if what is None else f"; {what()}"
            raise AssertionError(f"not after {PATIENCE_S:g} s: {_line(happens)}{shown}")
        if meanwhile is not None:
            meanwhile()
        time.sleep(LOOK_S)
    return happened


def _line(happens: Callable[[], object]) -> str:
    """Where it is written what is awaited."""
    if not isinstance(happens, FunctionType):
        return repr(happens)
    code = happens.__code__
    return linecache.getline(code.co_filename, code.co_firstlineno).strip()
