"""Names of drones: which one a machine's drone has, which one a pilot means, and how they are
printed. Pure."""

import re
from collections.abc import Iterable, Sequence

from services.runtime.bus.spaces import LONGEST

SHOWN = 8  # names in one sentence
LONGEST_WORDS = 120  # [characters] of a text from a network


def own_name(vehicle: str, host: str) -> str:
    """Of a drone that was given none: its type and its computer, such as `pioneer-boat`.

    Args:
        host: name of the computer, whatever letters it has.
    """
    machine = re.sub(r"[^A-Za-z0-9_-]+", "-", host.partition(".")[0]).strip("-")
    return f"{vehicle}-{machine}"[:LONGEST].rstrip("-")


def in_words(names: Iterable[str]) -> str:
    """`a, b and 3 more`, in their order."""
    every = sorted(names)
    shown, more = every[:SHOWN], len(every) - SHOWN
    return f"{', '.join(shown)} and {more} more" if more > 0 else ", ".join(shown)


def missing(wanted: str, there: Sequence[str], endpoint: str) -> str:
    """Why a pilot who wants a drone of this name cannot have it."""
    who = f"there are {in_words(there)}" if there else "nobody is there"
    return f"no drone is called {wanted} at {endpoint}; {who}"


def other_drone(wanted: str, there: Sequence[str], *, was_there: bool = False) -> str:
    """What a topside that waits for a drone is to be told; empty: nothing is wrong. One that had
    its drone must go on waiting: it may be armed, and comes back by itself."""
    if wanted in there or not there:
        return ""
    if was_there:
        return f"{wanted} has left the network, where {in_words(there)} can be reached: waiting \
for it"
    other = sorted(there)[0]
    return (
        f"this is the topside of {wanted}, and only {in_words(there)} can be reached: end it, and "
        f"start it with --name {other}"
    )


def clean(text: str, longest: int = LONGEST_WORDS) -> str:
    """Text from a network, of which nothing can act on a terminal."""
    kept = "".join(letter if letter.isprintable() else "?" for letter in text[: longest + 1])
    return kept if len(kept) <= longest else f"{kept[: longest - 1]}…"
