"""A stack file: the services of a dive and the sides they are on, read and checked."""

import importlib.util
import pkgutil
import re
from collections.abc import Iterator, Mapping
from functools import cache
from pathlib import Path
from typing import Annotated, Any

import msgspec

import services
from services.runtime.config.errors import LindyError
from services.runtime.config.settings import convert, deploy_file, line_of, nearest, read_toml
from services.runtime.config.stack import BODY

HERE = services.__name__  # `services`; in an installed package `lindy.services`
SideName = Annotated[str, msgspec.Meta(pattern="^(topside|drone)$")]
TAKEN = (BODY, "supervisor", "hub_topside", "hub_drone")  # they mean something else
NAMES = f"allowed are a to z, 0 to 9 and _, and not {' or '.join(TAKEN)}"  # parts of keys
SIMULATOR = "simulator"  # a whole vehicle; a driver may be one part of several
ONE_EACH = ("estimation", "reference", "control")  # two of them contradict each other


class ServiceSpec(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """A service of a stack file."""

    sides: Annotated[list[SideName], msgspec.Meta(min_length=1)]  # the first is its home side
    gateway: bool = False  # it connects the sides, and publishes its own BOTH topics on each
    vehicle_side: bool = False  # it is the vehicle, or part of it: sensors, thrusters
    each_machine: bool = False  # runs on each machine, where its sides are two machines
    process: str | None = None  # services with the same name here share an OS process
    service: str | None = None  # Lindy's service whose code it runs; None: that of its name
    module: str | None = None  # a user's module; None: one of Lindy's own services
    in_place_of: str | None = None  # a service of the stack that is extended, which is left out


class StackFile(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    extends: str = ""  # a name in deploy/stacks, whose services are here as well; empty: none
    services: dict[str, dict[str, Any]] = {}


Specs = Mapping[str, ServiceSpec]  # by name, in the order of the file


def read_specs(file: Path) -> Specs:
    """The services of a stack file, not yet checked.

    Raises:
        LindyError: it cannot be read, or a key is wrong.
    """
    return {
        name: convert(table, ServiceSpec, f"services.{name}", file)
        for name, table in _tables(file).items()
    }


def _tables(file: Path) -> dict[str, dict[str, Any]]:
    """With those of the stack that it extends: a table of the same name adds and changes keys, one
    with `in_place_of` takes a service's place, and others come last."""
    own, tables = convert(read_toml(file), StackFile, "", file), dict[str, dict[str, Any]]()
    for base in bases(file)[:1]:
        tables = _tables(base)
    for name, table in own.services.items():
        if (left_out := table.get("in_place_of", name)) != name and left_out not in tables:
            known = ", ".join(tables) or "none, because this file extends no stack"
            at = place(file, name, "in_place_of")
            raise LindyError(f"{at}: there is no service {left_out!r} to replace; known: {known}")
        table = {key: value for key, value in table.items() if key != "in_place_of"}
        tables = {name if n == left_out else n: each for n, each in tables.items()}
        tables[name] = table if left_out != name else {**tables.get(name, {}), **table}
    return tables


def bases(file: Path) -> list[Path]:
    """The stack files that a stack file extends, the nearest first.

    Raises:
        LindyError: there is none of this name, or one cannot be read.
    """
    if not (name := convert(read_toml(file), StackFile, "", file).extends):
        return []
    at = f"{file}{line_of(file, ('extends',))}: extends"
    if name.endswith(".toml"):
        raise LindyError(f"{at}: {name!r} is a file; allowed is a name in deploy/stacks")
    try:
        base = deploy_file("stacks", name)
    except LindyError as error:
        raise LindyError(f"{at}: {error}") from None
    return [base, *bases(base)]


def code_of(name: str, spec: ServiceSpec) -> str:
    """Lindy's service whose code a service runs."""
    return spec.service or name


def place(file: Path, name: str, key: str = "") -> str:
    """The file, the line and the key, for an error."""
    path = ("services", name, key) if key else ("services", name)
    return f"{file}{line_of(file, path)}: {'.'.join(path)}"


def check(specs: Specs, file: Path) -> None:
    """Raises LindyError: a service cannot be as the file has it, beside the others."""
    for name, key, words in _wrong(specs):
        raise LindyError(f"{place(file, name, key)}: {words}")


def _wrong(specs: Specs) -> Iterator[tuple[str, str, str]]:
    """Service, key and what is wrong with it, the gravest first."""
    for name, spec in specs.items():
        yield from _of_one(name, spec)
    yield from _processes(specs)
    first = dict[str, str]()  # name, by code
    for name, spec in specs.items():
        code = code_of(name, spec)
        if spec.module is None and code in ONE_EACH and first.setdefault(code, name) != name:
            why = f"it runs the code of {code}, and so does {first[code]}"
            yield name, "", f"{why}; the two would contradict each other, allowed is one"
    gateways = [name for name, spec in specs.items() if spec.gateway]
    if len(gateways) > 1:
        why = f"{gateways[0]} is the gateway already, and every message would cross twice"
        yield gateways[1], "gateway", f"{why}; allowed is one"
    vehicles = [name for name, spec in specs.items() if spec.vehicle_side]
    whole = [n for n in vehicles if specs[n].module is None and code_of(n, specs[n]) == SIMULATOR]
    if whole and len(vehicles) > 1:
        other = next(name for name in reversed(vehicles) if name != whole[0])
        why = f"{whole[0]} is a whole vehicle already; allowed is one of the two"
        yield other, "vehicle_side", why


def _of_one(name: str, spec: ServiceSpec) -> Iterator[tuple[str, str, str]]:
    code, module, sides = code_of(name, spec), spec.module, spec.sides
    if not _is_name(name):
        yield name, "", f"a service cannot be called {name!r}; {NAMES}"
    if module is not None and not all(part.isidentifier() for part in module.split(".")):
        allowed = (
            "that of an installed one such as my_lab.my_driver, or of a file beside the stack "
            "file, without .py"
        )
        yield name, "module", f"{module!r} is no name of a module; allowed: {allowed}"
    if module is None and code not in own_services():
        why = f"Lindy has no service {code!r}, and no module is named for it"
        yield name, "", f"{why}{nearest(code, own_services())}"
    if len({*sides}) < len(sides):
        yield name, "sides", f"{sides[0]!r} is there twice; allowed is each side once"
    found = f'on board; allowed is ["drone"], found {sides}'
    if module is None and code in ONE_EACH and sides != ["drone"]:
        yield name, "sides", f"it is {found}"
    if spec.vehicle_side and sides != ["drone"]:
        yield name, "sides", f"a service with vehicle_side = true is {found}"
    if spec.gateway and len(sides) < 2:
        why = "a service with gateway = true connects the sides"
        yield name, "sides", f'{why}; allowed is ["topside", "drone"], found {sides}'


def _processes(specs: Specs) -> Iterator[tuple[str, str, str]]:
    first: dict[str, str] = {}  # service of each process
    for name, spec in specs.items():
        if (process := spec.process) is None:
            continue
        other = first.setdefault(process, name)
        side, others = spec.sides[0], specs[other].sides[0]
        why = ""
        if not _is_name(process):
            why = f"a process cannot be called {process!r}; {NAMES}"
        elif process in specs and specs[process].process != process:
            why = (
                f"{process!r} is a service that is not in this process; allowed is a name that no "
                f"service has, or process = {process!r} for it as well"
            )
        elif side != others:
            why = (
                f"process {process!r} has {other}, whose home is the {others}, and {name}, whose "
                f"home is the {side}; allowed are services with the same home, the first of their "
                f"sides"
            )
        if why:
            yield name, "process", why


def _is_name(name: str) -> bool:
    return name not in TAKEN and re.fullmatch(r"[a-z0-9_]+", name) is not None


@cache
def own_services() -> list[str]:
    """Names of Lindy's own services."""
    folders = [module.name for module in pkgutil.iter_modules(services.__path__) if module.ispkg]
    return sorted(n for n in folders if importlib.util.find_spec(f"{HERE}.{n}.service"))
