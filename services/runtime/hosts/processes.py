"""Which services share an OS process."""

import re
from pathlib import Path

import msgspec

from services.runtime.config.errors import LindyError
from services.runtime.hosts.stack_file import NAME, TAKEN, ServiceSpec, Specs, code_of, place

PROCESS_OF_SIDE = {"topside": "topside", "drone": "onboard"}  # with --grouped


def processes_of(specs: Specs) -> dict[str, list[str]]:
    """The OS processes by name, and the services in each."""
    processes: dict[str, list[str]] = {}
    for name, spec in specs.items():
        processes.setdefault(spec.process or name, []).append(name)
    return processes


def shared_processes(specs: Specs) -> dict[str, str]:
    """The process of each service that is not alone in a process of its own name."""
    return {
        name: process
        for process, names in processes_of(specs).items()
        if names != [process]
        for name in names
    }


def few_processes(specs: Specs) -> Specs:
    """Services that have no process of their own share one for each home side."""
    return {
        name: msgspec.structs.replace(spec, process=spec.process or PROCESS_OF_SIDE[spec.sides[0]])
        for name, spec in specs.items()
    }


def two_machines(specs: Specs) -> Specs:
    """A service that runs on each machine has its own name on the second one."""
    split: dict[str, ServiceSpec] = {}
    for name, spec in specs.items():
        if not spec.each_machine:
            split[name] = spec
            continue
        for side in spec.sides:
            instance = name if side == spec.sides[0] else f"{name}_{side}"
            split[instance] = msgspec.structs.replace(
                spec,
                sides=[side],
                each_machine=False,
                service=code_of(name, spec),
                process=instance if spec.process == name else spec.process,
            )
    return split


def require_processes(specs: Specs, file: Path) -> None:
    """
    Args:
        file: the stack file, for the error.

    Raises:
        LindyError: a process has a name that is not allowed, or services of both sides.
    """
    first: dict[str, str] = {}  # service of each process
    for name, spec in specs.items():
        if (process := spec.process) is None:
            continue
        at, other = place(file, name, "process"), first.setdefault(process, name)
        if process in TAKEN or not re.fullmatch(NAME, process):
            raise LindyError(
                f"{at}: a process cannot be called {process!r}; allowed are a to z, 0 to 9 and "
                f"_, and not {' or '.join(TAKEN)}"
            )
        if process in specs and specs[process].process != process:
            raise LindyError(
                f"{at}: {process!r} is a service that is not in this process; allowed is a "
                f"name that no service has, or process = {process!r} for it as well"
            )
        if spec.sides[0] != (side := specs[other].sides[0]):
            raise LindyError(
                f"{at}: process {process!r} has {other}, whose home is the {side}, and {name}, "
                f"whose home is the {spec.sides[0]}; allowed are services with the same home, "
                f"the first of their sides"
            )
