"""The verb `lindy check-driver`."""

import tempfile
from collections.abc import Generator
from contextlib import contextmanager
from pathlib import Path
from typing import Annotated

from cyclopts import Parameter

from services.runtime.config.errors import LindyError, NeedsRealTimeError
from tools.driver.bench import Bench, BrokenRuleError, real_bench, virtual_bench
from tools.driver.rules import MOVES, RULES, sentence

TURNS = (
    "this driver needs real time, and its thrusters will turn: take the propellers off, then say "
    "--thrusters-may-turn"
)


def check_driver(
    stack: Annotated[str, Parameter(help="a name in deploy/stacks, or the path of a TOML file")],
    vehicle: Annotated[str, Parameter(help="a name, or the path of a TOML file")],
    /,
    *,
    still: Annotated[
        bool, Parameter(help="the vehicle is out of the water: leave out what needs motion")
    ] = False,
    thrusters_may_turn: Annotated[
        bool, Parameter(help="the propellers are off, or nothing is near them")
    ] = False,
) -> int:
    """Check that a driver keeps what every vehicle side promises.

    Its service runs alone, on virtual time, or as a process if it needs real time; somebody else
    commands its thrusters. One line a rule; the exit status is 0 where all are kept, else 1.

    Example: lindy check-driver my_stack.toml my_vehicle.toml
    """
    broken = 0
    for rule in RULES:
        if still and rule in MOVES:
            print(f"left out  {sentence(rule)}", flush=True)
            continue
        try:
            with bench(stack, vehicle, may_turn=thrusters_may_turn) as made:
                made.settle()
                rule(made)
        except BrokenRuleError as why:
            broken += 1
            print(f"broken    {sentence(rule)} But: {why}.", flush=True)
        else:
            print(f"kept      {sentence(rule)}", flush=True)
    return int(broken > 0)


@contextmanager
def bench(stack: str, vehicle: str, *, may_turn: bool) -> Generator[Bench]:
    """On virtual time where the driver can."""
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        try:
            made = virtual_bench(stack, vehicle, folder)
        except NeedsRealTimeError:
            if not may_turn:
                raise LindyError(TURNS) from None
            with real_bench(stack, vehicle, folder) as made:
                yield made
        else:
            yield made
