"""The services of a stack, and where the code of each is found: name → module → `wire`.

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
from collections.abc import Callable, Collection, Iterator, Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from types import ModuleType
from typing import Annotated, Any

import msgspec

import services
from messages import topics
from messages.topic import AnyTopic
from services.runtime.config.errors import LindyError
from services.runtime.config.settings import convert, deploy_file, line_of, nearest, read_toml
from services.runtime.config.stack import BODY, Stack
from services.runtime.node.node import Node

Wire = Callable[[Node, Stack], None]
SideName = Annotated[str, msgspec.Meta(pattern="^(topside|drone)$")]
DEFAULT = "simulated"  # the stack of a dive without --stack
NAME = r"[a-z0-9_]+"  # of a service: it becomes part of a key
SIMULATOR = "simulator"  # a whole vehicle; a driver may be one part of several
# What somebody must publish in a dive, and which of Lindy's own services does.
NEEDED: dict[str, AnyTopic] = {
    "gamepad": topics.PILOT_COMMAND,
    "estimation": topics.STATE,
    "reference": topics.REFERENCE,
    "control": topics.THRUSTERS,
}
TAKEN = (BODY, "supervisor", "hub_topside", "hub_drone")  # they mean something else
PROCESS_OF_SIDE = {"topside": "topside", "drone": "onboard"}  # with --grouped


class ServiceSpec(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """A service of a stack file."""

    sides: Annotated[list[SideName], msgspec.Meta(min_length=1)]  # the first is its home side
    gateway: bool = False  # it connects the sides, and publishes its own BOTH topics on each
    vehicle_side: bool = False  # it is the vehicle, or part of it: sensors, thrusters
    each_machine: bool = False  # runs on each machine, where its sides are two machines
    process: str | None = None  # services with the same name here share an OS process
    service: str | None = None  # Lindy's service whose code it runs; None: that of its name
    module: str | None = None  # a user's module; None: one of Lindy's own services


class StackFile(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    services: dict[str, dict[str, Any]] = {}


@dataclass(frozen=True, slots=True)
class Registry(Mapping[str, ServiceSpec]):
    """The services of one stack file, by name, in its order."""

    file: Path
    specs: Mapping[str, ServiceSpec]

    @classmethod
    def read(cls, stack: str = DEFAULT) -> "Registry":
        """
        Args:
            stack: a name in deploy/stacks, or the path of a TOML file.

        Raises:
            LindyError: no such file, or a mistake in it.
        """
        file = deploy_file("stacks", stack)
        tables = convert(read_toml(file), StackFile, "", file).services
        specs = {n: convert(t, ServiceSpec, f"services.{n}", file) for n, t in tables.items()}
        registry = cls(file.resolve(), specs)
        for name in specs:
            registry._require_known(name)
            registry._require_possible_sides(name)
        registry._require_processes()
        if not registry.vehicle_side:
            raise LindyError(
                f"{file}: no service is the vehicle; one of them must have vehicle_side = true"
            )
        registry._require_one_of_a_kind()
        return registry

    def __getitem__(self, name: str) -> ServiceSpec:
        return self.specs[name]

    def __iter__(self) -> Iterator[str]:
        return iter(self.specs)

    def __len__(self) -> int:
        return len(self.specs)

    @property
    def vehicle_side(self) -> dict[str, str]:
        """Names of the services that are the vehicle, with the module each is found in."""
        return {n: self._module(n) for n, spec in self.specs.items() if spec.vehicle_side}

    def only(self, specs: Mapping[str, ServiceSpec]) -> "Registry":
        """The same stack file with only these services."""
        return replace(self, specs=specs)

    def apart(self) -> "Registry":
        """The same stack where topside and drone are two machines. A service that runs on each
        machine has its own name on the second one, because each side receives the other's health
        messages."""
        split: dict[str, ServiceSpec] = {}
        for name, spec in self.specs.items():
            if not spec.each_machine:
                split[name] = spec
                continue
            for side in spec.sides:
                instance = name if side == spec.sides[0] else f"{name}_{side}"
                split[instance] = msgspec.structs.replace(
                    spec,
                    sides=[side],
                    each_machine=False,
                    service=self._code(name),
                    process=instance if spec.process == name else spec.process,
                )
        return self.only(split)

    def require_whole(self) -> None:
        """Check that there is a service for everything that a dive needs. What a module of the
        user's publishes is not known before it runs, so each may replace one of Lindy's own.

        Raises:
            LindyError: names what nobody publishes.
        """
        codes = [self._code(name) for name, spec in self.specs.items() if spec.module is None]
        missing = [own for own in NEEDED if own not in codes and own not in self.specs]
        others = [s for n, s in self.specs.items() if s.module is not None and n not in NEEDED]
        if len(missing) > sum(not spec.vehicle_side for spec in others):
            raise self._unpublished(missing)
        if not any(spec.gateway for spec in self.specs.values()):
            raise LindyError(
                f"{self.file}: services: none connects the topside with the drone; one must have "
                f"gateway = true, such as Lindy's own tether"
            )

    def require_published(self, published: Mapping[str, Collection[AnyTopic]]) -> None:
        """Check it again where it is known what each service publishes.

        Args:
            published: topics by service.

        Raises:
            LindyError: names what nobody publishes, or two that both are the vehicle.
        """
        everything = {topic for own in published.values() for topic in own}
        if missing := [own for own, topic in NEEDED.items() if topic not in everything]:
            raise self._unpublished(missing)
        vehicles = [name for name, own in published.items() if topics.ACTUATION in own]
        if len(vehicles) > 1:
            raise LindyError(
                f"{self._at(vehicles[1])}: it publishes {topics.ACTUATION.key}, and so does "
                f"{vehicles[0]}; allowed is one vehicle"
            )

    def _unpublished(self, missing: Collection[str]) -> LindyError:
        keys = " and ".join(NEEDED[own].key for own in missing)
        tables = " and ".join(f"[services.{own}]" for own in missing)
        return LindyError(
            f"{self.file}: services: nobody publishes {keys}, without which no dive begins; "
            f"allowed: {tables}, or a module of your own that publishes it"
        )

    def grouped(self) -> "Registry":
        """The same stack with few processes: services that have none of their own share one for
        each home side.

        Raises:
            LindyError: a service that is not in such a process has its name.
        """
        grouped = self.only(
            {
                name: msgspec.structs.replace(
                    spec, process=spec.process or PROCESS_OF_SIDE[spec.sides[0]]
                )
                for name, spec in self.specs.items()
            }
        )
        grouped._require_processes()
        return grouped

    @property
    def processes(self) -> dict[str, list[str]]:
        """The OS processes by name, and the services in each."""
        processes: dict[str, list[str]] = {}
        for name, spec in self.specs.items():
            processes.setdefault(spec.process or name, []).append(name)
        return processes

    @property
    def shared(self) -> dict[str, str]:
        """The process of each service that is not alone in a process of its own name."""
        return {
            name: process
            for process, names in self.processes.items()
            if names != [process]
            for name in names
        }

    def wire(self, name: str) -> Wire:
        """The function that connects a service's core to its ports. Whatever it raises becomes one
        sentence.

        Raises:
            LindyError: there is no such module or function.
        """
        own = self.specs[name].module is None
        wire = wire_of(self._code(name)) if own else self._wire_of_others(name)

        def wired(node: Node, stack: Stack) -> None:
            try:
                wire(node, stack)
            except LindyError:
                raise
            except (Exception, SystemExit) as error:
                raise LindyError(f"module {self._module(name)}: {_in_words(error)}") from error

        return wired

    def failure(self, name: str, error: BaseException) -> LindyError:
        """What a handler of a service raised in mid-dive, in one sentence: which service, which
        module, which line."""
        module = sys.modules.get(self._module(name))
        line = _line_in(module, error)
        whose = f"{name} (module {self._module(name)})"
        if self.specs[name].module is None:
            whose = f"an error in Lindy itself: {whose}"
        what = "ended itself" if isinstance(error, SystemExit) else "failed"
        at = f"{line.filename}:{line.lineno}:"
        return LindyError(f"{whose} {what} at {at} {_in_words(error)}")

    def tables(self, here: Collection[str] | None = None) -> dict[str, type | None]:
        """The tables that a vehicle file may have for services: for those of this stack, and for
        all of Lindy's own, because a vehicle file suits more than one stack. None: a user's module
        has no settings.

        Args:
            here: the services that run on this machine; None: all. A user's module need not be
                installed on the other machine, so its table is not checked there.

        Raises:
            LindyError: a module of this stack cannot be used.
        """
        own = {name: own_settings(name) for name in own_services()}
        found: dict[str, type | None] = {n: kind for n, kind in own.items() if kind is not None}
        for name, spec in self.specs.items():
            if spec.module is not None:
                at_home = here is None or name in here
                found[name] = self._settings_of_others(name) if at_home else dict
        return found

    def _require_known(self, name: str) -> None:
        if name in TAKEN or not re.fullmatch(NAME, name):
            raise LindyError(
                f"{self._at(name)}: a service cannot be called {name!r}; allowed are a to z, 0 to "
                f"9 and _, and not {' or '.join(TAKEN)}"
            )
        code, module = self._code(name), self.specs[name].module
        if module is not None and not all(part.isidentifier() for part in module.split(".")):
            raise LindyError(
                f"{self._at(name, 'module')}: {module!r} is no name of a module; allowed: that of "
                f"an installed one such as my_lab.my_driver, or of a file beside the stack file, "
                f"without .py"
            )
        if module is None and code not in own_services():
            raise LindyError(
                f"{self._at(name)}: Lindy has no service {code!r}, and no module is named for it"
                f"{nearest(code, own_services())}"
            )

    def _require_possible_sides(self, name: str) -> None:
        spec = self.specs[name]
        at = self._at(name, "sides")
        if len(set(spec.sides)) < len(spec.sides):
            raise LindyError(f"{at}: {spec.sides[0]!r} is there twice; allowed is each side once")
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

    def _require_one_of_a_kind(self) -> None:
        gateways = [name for name, spec in self.specs.items() if spec.gateway]
        if len(gateways) > 1:
            raise LindyError(
                f"{self._at(gateways[1], 'gateway')}: {gateways[0]} is the gateway already, and "
                f"every message would cross twice; allowed is one"
            )
        vehicles = [*self.vehicle_side]
        simulators = [n for n in vehicles if self._module(n) == f"services.{SIMULATOR}"]
        if simulators and len(vehicles) > 1:
            other = next(name for name in reversed(vehicles) if name != simulators[0])
            raise LindyError(
                f"{self._at(other, 'vehicle_side')}: {simulators[0]} is a whole vehicle already; "
                f"allowed is one of the two"
            )

    def _require_processes(self) -> None:
        first: dict[str, str] = {}  # service of each process
        for name, spec in self.specs.items():
            if (process := spec.process) is None:
                continue
            at, other = self._at(name, "process"), first.setdefault(process, name)
            if process in TAKEN or not re.fullmatch(NAME, process):
                raise LindyError(
                    f"{at}: a process cannot be called {process!r}; allowed are a to z, 0 to 9 and "
                    f"_, and not {' or '.join(TAKEN)}"
                )
            if process in self.specs and self.specs[process].process != process:
                raise LindyError(
                    f"{at}: {process!r} is a service that is not in this process; allowed is a "
                    f"name that no service has, or process = {process!r} for it as well"
                )
            if spec.sides[0] != (side := self.specs[other].sides[0]):
                raise LindyError(
                    f"{at}: process {process!r} has {other}, whose home is the {side}, and {name}, "
                    f"whose home is the {spec.sides[0]}; allowed are services with the same home, "
                    f"the first of their sides"
                )

    def _code(self, name: str) -> str:
        return self.specs[name].service or name

    def _module(self, name: str) -> str:
        return self.specs[name].module or f"services.{self._code(name)}"

    def _at(self, name: str, key: str = "") -> str:
        """The file, the line and the key, for an error."""
        path = ("services", name, key) if key else ("services", name)
        return f"{self.file}{line_of(self.file, path)}: {'.'.join(path)}"

    def _wire_of_others(self, name: str) -> Wire:
        module = self._others(name)
        wire: Wire | None = getattr(module, "wire", None)
        if not callable(wire):
            raise LindyError(
                f"{self._at(name, 'module')}: module {module.__name__!r} ({module.__file__}) has "
                f"no function wire(node, stack)"
            )
        return wire

    def _settings_of_others(self, name: str) -> type | None:
        self._wire_of_others(name)  # a module without one is no service
        settings = getattr(self._others(name), "Settings", None)
        if settings is None or _is_strict(settings):
            return settings
        raise LindyError(
            f"{self._at(name, 'module')}: Settings of module {self._module(name)!r} must be a "
            f"class of the kind (msgspec.Struct, frozen=True, forbid_unknown_fields=True)"
        )

    def _others(self, name: str) -> ModuleType:
        """Import a module that is not Lindy's own."""
        module, folder = self._module(name), str(self.file.parent)
        if folder not in sys.path:
            sys.path.append(folder)  # at the end: nothing there can replace an installed module
        try:
            return importlib.import_module(module)
        except (Exception, SystemExit) as error:
            at = self._at(name, "module")
            if isinstance(error, ModuleNotFoundError) and _is_part(error.name, module):
                raise LindyError(
                    f"{at}: there is no module {module!r}; allowed: an installed module, or a file "
                    f"beside the stack file"
                ) from None
            raise LindyError(
                f"{at}: module {module!r} cannot be imported: {_in_words(error)}"
            ) from error


def own_services() -> list[str]:
    """Names of Lindy's own services."""
    folders = [module.name for module in pkgutil.iter_modules(services.__path__) if module.ispkg]
    return sorted(n for n in folders if importlib.util.find_spec(f"services.{n}.service"))


def own_settings(name: str) -> type | None:
    """The settings that one of Lindy's own services reads from a vehicle file."""
    return getattr(importlib.import_module(f"services.{name}.core"), "Settings", None)


def wire_of(name: str) -> Wire:
    """`wire` of one of Lindy's own services."""
    return importlib.import_module(f"services.{name}.service").wire


def _is_part(found: str | None, module: str) -> bool:
    """Was the module itself, or a package that contains it, not found?"""
    return found is not None and (module == found or module.startswith(f"{found}."))


def _is_strict(settings: Any) -> bool:
    """Does it refuse the keys it does not know?"""
    if not isinstance(settings, type) or not issubclass(settings, msgspec.Struct):
        return False
    return settings.__struct_config__.forbid_unknown_fields


def _line_in(module: ModuleType | None, error: BaseException) -> traceback.FrameSummary:
    """Where an error came from: the innermost line of the module or of a file beside it, because
    what it called there is seldom at fault; else the innermost line of all."""
    frames = traceback.extract_tb(error.__traceback__)
    file = getattr(module, "__file__", None)
    own = [f for f in frames if file is not None and Path(f.filename).parent == Path(file).parent]
    return (own or frames)[-1]


def _in_words(error: BaseException) -> str:
    return f"{type(error).__name__}: {' '.join(str(error).split())}"
