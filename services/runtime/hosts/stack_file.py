"""A stack file: the services of a dive, the sides they are on and where their code is found.

One of Lindy's own services is `services.<name>`: its `wire` is in `.service`, its `Settings`, if it
has any, in `.core`. Any other service is the module that its table in the stack file names, with
`wire` and `Settings` in that module itself. Such a module is looked for among the installed
packages and then in the folder of the stack file.
"""

import importlib
import importlib.util
import pkgutil
import re
import sys
import traceback
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path
from types import ModuleType
from typing import Annotated, Any

import msgspec

import services
from services.runtime.config.errors import LindyError
from services.runtime.config.settings import (
    convert,
    deploy_file,
    line_of,
    nearest,
    read_toml,
)
from services.runtime.config.stack import BODY, Stack
from services.runtime.node.node import Node

Wire = Callable[[Node, Stack], None]
HERE = services.__name__  # `services`; in an installed package `lindy.services`
SideName = Annotated[str, msgspec.Meta(pattern="^(topside|drone)$")]
NAME = r"[a-z0-9_]+"  # of a service: it becomes part of a key
TAKEN = (BODY, "supervisor", "hub_topside", "hub_drone")  # they mean something else
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


def module_of(name: str, spec: ServiceSpec, file: Path) -> "ServiceModule":
    """The module of a service; `file` is the stack file."""
    return ServiceModule(file, name, code_of(name, spec), spec.module)


def place(file: Path, name: str, key: str = "") -> str:
    """The file, the line and the key, for an error."""
    path = ("services", name, key) if key else ("services", name)
    return f"{file}{line_of(file, path)}: {'.'.join(path)}"


def require_possible(specs: Specs, file: Path) -> None:
    """
    Raises:
        LindyError: a service cannot have its name or its sides, or there is no code for it.
    """
    for name, spec in specs.items():
        _require_known(name, spec, file)
        _require_possible_sides(name, spec, file)


def require_one_of_a_kind(specs: Specs, file: Path) -> None:
    """
    Raises:
        LindyError: two services are the gateway, a whole vehicle, or one of `ONE_EACH`.
    """
    first = dict[str, str]()  # name, by code
    for name, spec in specs.items():
        code = code_of(name, spec)
        if spec.module is None and code in ONE_EACH and first.setdefault(code, name) != name:
            raise LindyError(
                f"{place(file, name)}: it runs the code of {code}, and so does {first[code]}; "
                f"the two would contradict each other, allowed is one"
            )
    gateways = [name for name, spec in specs.items() if spec.gateway]
    if len(gateways) > 1:
        raise LindyError(
            f"{place(file, gateways[1], 'gateway')}: {gateways[0]} is the gateway already, and "
            f"every message would cross twice; allowed is one"
        )
    vehicles = {n: module_of(n, spec, file) for n, spec in specs.items() if spec.vehicle_side}
    simulators = [
        n for n, module in vehicles.items() if module.users is None and module.code == SIMULATOR
    ]
    if simulators and len(vehicles) > 1:
        other = next(name for name in reversed(vehicles) if name != simulators[0])
        raise LindyError(
            f"{place(file, other, 'vehicle_side')}: {simulators[0]} is a whole vehicle already; "
            f"allowed is one of the two"
        )


def require_processes(specs: Specs, file: Path) -> None:
    """
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


def _require_known(name: str, spec: ServiceSpec, file: Path) -> None:
    if name in TAKEN or not re.fullmatch(NAME, name):
        raise LindyError(
            f"{place(file, name)}: a service cannot be called {name!r}; allowed are a to z, 0 to "
            f"9 and _, and not {' or '.join(TAKEN)}"
        )
    code, module = code_of(name, spec), spec.module
    if module is not None and not all(part.isidentifier() for part in module.split(".")):
        raise LindyError(
            f"{place(file, name, 'module')}: {module!r} is no name of a module; allowed: that of "
            f"an installed one such as my_lab.my_driver, or of a file beside the stack file, "
            f"without .py"
        )
    if module is None and code not in own_services():
        raise LindyError(
            f"{place(file, name)}: Lindy has no service {code!r}, and no module is named for it"
            f"{nearest(code, own_services())}"
        )


def _require_possible_sides(name: str, spec: ServiceSpec, file: Path) -> None:
    at = place(file, name, "sides")
    if len(set(spec.sides)) < len(spec.sides):
        raise LindyError(f"{at}: {spec.sides[0]!r} is there twice; allowed is each side once")
    if spec.module is None and code_of(name, spec) in ONE_EACH and spec.sides != ["drone"]:
        raise LindyError(f'{at}: it is on board; allowed is ["drone"], found {spec.sides}')
    if spec.vehicle_side and spec.sides != ["drone"]:
        raise LindyError(
            f'{at}: a service with vehicle_side = true is on board; allowed is ["drone"], '
            f"found {spec.sides}"
        )
    if spec.gateway and len(spec.sides) < 2:
        raise LindyError(
            f"{at}: a service with gateway = true connects the sides; allowed is "
            f'["topside", "drone"], found {spec.sides}'
        )


def own_services() -> list[str]:
    """Names of Lindy's own services."""
    folders = [module.name for module in pkgutil.iter_modules(services.__path__) if module.ispkg]
    return sorted(n for n in folders if importlib.util.find_spec(f"{HERE}.{n}.service"))


def own_settings(name: str) -> type | None:
    """The settings that one of Lindy's own services reads from a vehicle file."""
    return getattr(importlib.import_module(f"{HERE}.{name}.core"), "Settings", None)


def wire_of(name: str) -> Wire:
    """`wire` of one of Lindy's own services."""
    return importlib.import_module(f"{HERE}.{name}.service").wire


@dataclass(frozen=True, slots=True)
class ServiceModule:
    """The module of one service of a stack file."""

    file: Path  # the stack file
    service: str  # its name there
    code: str  # the one of Lindy's own services that it runs
    users: str | None  # a user's module; None: one of Lindy's own services

    @property
    def name(self) -> str:
        return self.users or f"{HERE}.{self.code}"

    def wire(self) -> Wire:
        """As `Registry.wire`."""
        wire = wire_of(self.code) if self.users is None else self._wire_of_users()

        def wired(node: Node, stack: Stack) -> None:
            try:
                wire(node, stack)
            except LindyError:
                raise
            except (Exception, SystemExit) as error:
                raise LindyError(f"module {self.name}: {_in_words(error)}") from error

        return wired

    def failure(self, error: BaseException) -> LindyError:
        """As `Registry.failure`."""
        if isinstance(error, MemoryError):  # of the computer, or of a limit: nobody's mistake
            return LindyError(f"{self.service} has no memory left")
        line = _line_in(sys.modules.get(self.name), error)
        whose = f"{self.service} (module {self.name})"
        if self.users is None:
            whose = f"an error in Lindy itself: {whose}"
        what = "ended itself" if isinstance(error, SystemExit) else "failed"
        at = f"{line.filename}:{line.lineno}:"
        return LindyError(f"{whose} {what} at {at} {_in_words(error)}")

    def settings_of_users(self) -> type | None:
        """The settings that a user's module reads from a vehicle file.

        Raises:
            LindyError: the module cannot be used.
        """
        self._wire_of_users()  # a module without one is no service
        settings: Any = getattr(self._imported(), "Settings", None)
        config = getattr(settings, "__struct_config__", None)
        if settings is None or (config is not None and config.forbid_unknown_fields):
            return settings
        raise LindyError(
            f"{self._at()}: Settings of module {self.name!r} must be a "
            f"class of the kind (msgspec.Struct, frozen=True, forbid_unknown_fields=True)"
        )

    def _wire_of_users(self) -> Wire:
        module = self._imported()
        wire: Wire | None = getattr(module, "wire", None)
        if not callable(wire):
            raise LindyError(
                f"{self._at()}: module {module.__name__!r} ({module.__file__}) has "
                f"no function wire(node, stack)"
            )
        return wire

    def _imported(self) -> ModuleType:
        """Import a module that is not Lindy's own."""
        folder = str(self.file.parent)
        if folder not in sys.path:
            sys.path.append(folder)  # at the end: nothing there can replace an installed module
        try:
            return importlib.import_module(self.name)
        except (Exception, SystemExit) as error:
            missing = error.name if isinstance(error, ModuleNotFoundError) else None
            if missing and f"{self.name}.".startswith(f"{missing}."):  # itself, or its package
                raise LindyError(
                    f"{self._at()}: there is no module {self.name!r}; allowed: an installed "
                    f"module, or a file beside the stack file"
                ) from None
            raise LindyError(
                f"{self._at()}: module {self.name!r} cannot be imported: {_in_words(error)}"
            ) from error

    def _at(self) -> str:
        return place(self.file, self.service, "module")


def _line_in(module: ModuleType | None, error: BaseException) -> traceback.FrameSummary:
    """Where an error came from: the innermost line of the module or of a file beside it, because
    what it called there is seldom at fault; else the innermost line of all."""
    frames = traceback.extract_tb(error.__traceback__)
    file = getattr(module, "__file__", None)
    own = [f for f in frames if file is not None and Path(f.filename).parent == Path(file).parent]
    return (own or frames)[-1]


def _in_words(error: BaseException) -> str:
    return f"{type(error).__name__}: {' '.join(str(error).split())}"
