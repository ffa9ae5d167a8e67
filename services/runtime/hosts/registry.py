"""The services of a stack: what is asked of them as a whole, and where their code is found.

One of Lindy's own services is `services.<name>`: its `wire` is in `.service`, its `Settings`, if it
has any, in `.core`. Any other service is the module that its table in the stack file names, with
`wire` and `Settings` in that module itself. Such a module is looked for among the installed
packages and then in the folder of the stack file.
"""

import importlib
import sys
import traceback
from collections.abc import Callable, Collection, Iterator, Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from types import ModuleType
from typing import Any

import msgspec

from messages import topics
from messages.topic import AnyTopic
from services.runtime.config.errors import LindyError
from services.runtime.config.settings import deploy_file
from services.runtime.config.stack import Role, Stack
from services.runtime.hosts.stack_file import (
    HERE,
    ServiceSpec,
    check,
    code_of,
    own_services,
    place,
    read_specs,
)
from services.runtime.node.node import Node

Wire = Callable[[Node, Stack], None]
DEFAULT = "simulated"  # the stack of a dive without --stack
SHARED = {"topside": "topside", "drone": "onboard"}  # process of each side with --grouped
# What somebody must publish in a dive, and which of Lindy's own services does.
NEEDED: dict[str, AnyTopic] = {
    "gamepad": topics.PILOT_COMMAND,
    "estimation": topics.STATE,
    "reference": topics.REFERENCE,
    "control": topics.THRUSTERS,
}
ROLES: dict[str, Role] = {"recorder": "recorder", "link_monitor": "clock"}
INSTEAD = {"gamepad": ("mavlink", "cockpit", "ros2")}  # which others publish the same
PILOTS = ("gamepad", *INSTEAD["gamepad"])  # of Lindy's own services, those that command


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
        registry = cls(file.resolve(), read_specs(file))
        check(registry.specs, registry.file)
        if not registry.vehicle_side:
            raise LindyError(
                f"{file}: no service is the vehicle; one of them must have vehicle_side = true"
            )
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
                    service=code_of(name, spec),
                    process=instance if spec.process == name else spec.process,
                )
        return self.only(split)

    @property
    def watched(self) -> dict[str, Role]:
        """The services that the failsafes watch, and for what. On board the motion depends on the
        vehicle side, on what no dive can do without, and, as far as anybody knows, on each module
        of the user's."""
        found: dict[str, Role] = {}
        for name, spec in self.specs.items():
            code = code_of(name, spec)
            if (role := ROLES.get(code)) is not None:
                found[name] = role
            elif spec.sides[0] == "drone" and (
                spec.vehicle_side or spec.module is not None or code in NEEDED
            ):
                found[name] = "motion"
        return found

    def require_whole(self) -> None:
        """Check that there is a service for everything that a dive needs. What a module of the
        user's publishes is not known before it runs, so each may replace one of Lindy's own.

        Raises:
            LindyError: names what nobody publishes.
        """
        codes = [code_of(n, spec) for n, spec in self.specs.items() if spec.module is None]
        there = {*codes, *self.specs}
        missing = [own for own in NEEDED if not {own, *INSTEAD.get(own, ())} & there]
        others = [s for n, s in self.specs.items() if s.module is not None and n not in NEEDED]
        if len(missing) > sum(not spec.vehicle_side for spec in others):
            keys = " and ".join(NEEDED[own].key for own in missing)
            tables = " and ".join(f"[services.{own}]" for own in missing)
            raise LindyError(
                f"{self.file}: services: nobody publishes {keys}, without which no dive begins; "
                f"allowed: {tables}, or a module of your own that publishes it"
            )
        if not any(spec.gateway for spec in self.specs.values()):
            raise LindyError(
                f"{self.file}: services: none connects the topside with the drone; one must have "
                f"gateway = true, such as Lindy's own tether"
            )

    def grouped(self) -> "Registry":
        """The same stack with few processes: services that have none of their own share one for
        each home side.

        Raises:
            LindyError: a service that is not in such a process has its name.
        """
        grouped = {
            name: msgspec.structs.replace(spec, process=spec.process or SHARED[spec.sides[0]])
            for name, spec in self.specs.items()
        }
        check(grouped, self.file)
        return self.only(grouped)

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
        module = self._module(name)
        wire = wire_of(self._code(name)) if self[name].module is None else self._users_wire(name)

        def wired(node: Node, stack: Stack) -> None:
            try:
                wire(node, stack)
            except LindyError:
                raise
            except (Exception, SystemExit) as error:
                raise LindyError(f"module {module}: {_in_words(error)}") from error

        return wired

    def failure(self, name: str, error: BaseException) -> LindyError:
        """What a handler of a service raised in mid-dive, in one sentence: which service, which
        module, which line."""
        if isinstance(error, MemoryError):  # of the computer, or of a limit: nobody's mistake
            return LindyError(f"{name} has no memory left")
        module = self._module(name)
        line = _line_in(sys.modules.get(module), error)
        whose = f"{name} (module {module})"
        if self[name].module is None:
            whose = f"an error in Lindy itself: {whose}"
        what = "ended itself" if isinstance(error, SystemExit) else "failed"
        return LindyError(f"{whose} {what} at {line.filename}:{line.lineno}: {_in_words(error)}")

    def tables(
        self, here: Collection[str] | None = None, named: Collection[str] | None = None
    ) -> dict[str, type | None]:
        """The tables that a vehicle file may have for services: for those of this stack, and for
        all of Lindy's own, because a vehicle file suits more than one stack. None: a user's module
        has no settings.

        Args:
            here: the services that run on this machine; None: all. A user's module need not be
                installed on the other machine, so its table is not checked there.
            named: tables of the vehicle file. Of Lindy's own services those that have none and
                are not in this stack are not loaded, and have no type; None: all are.

        Raises:
            LindyError: a module of this stack cannot be used.
        """
        wanted = {*(named or ()), *(code_of(name, spec) for name, spec in self.specs.items())}
        own = {
            name: own_settings(name) if named is None or name in wanted else dict
            for name in own_services()
        }
        found: dict[str, type | None] = {n: kind for n, kind in own.items() if kind is not None}
        for name, spec in self.specs.items():
            if spec.module is not None:
                at_home = here is None or name in here
                found[name] = self._users_settings(name) if at_home else dict
        return found

    def _code(self, name: str) -> str:
        return code_of(name, self[name])

    def _module(self, name: str) -> str:
        return self[name].module or f"{HERE}.{self._code(name)}"

    def _users_settings(self, name: str) -> type | None:
        """The settings that a user's module reads from a vehicle file.

        Raises:
            LindyError: the module cannot be used.
        """
        self._users_wire(name)  # a module without one is no service
        settings: Any = getattr(self._imported(name), "Settings", None)
        config = getattr(settings, "__struct_config__", None)
        if settings is None or (config is not None and config.forbid_unknown_fields):
            return settings
        raise LindyError(
            f"{self._at(name)}: Settings of module {self._module(name)!r} must be a class of the "
            f"kind (msgspec.Struct, frozen=True, forbid_unknown_fields=True)"
        )

    def _users_wire(self, name: str) -> Wire:
        module = self._imported(name)
        wire: Wire | None = getattr(module, "wire", None)
        if not callable(wire):
            raise LindyError(
                f"{self._at(name)}: module {module.__name__!r} ({module.__file__}) has no function "
                f"wire(node, stack)"
            )
        return wire

    def _imported(self, name: str) -> ModuleType:
        """Import a module that is not Lindy's own."""
        folder, module = str(self.file.parent), self._module(name)
        if folder not in sys.path:
            sys.path.append(folder)  # at the end: nothing there can replace an installed module
        try:
            return importlib.import_module(module)
        except (Exception, SystemExit) as error:
            missing = error.name if isinstance(error, ModuleNotFoundError) else None
            why = f"module {module!r} cannot be imported: {_in_words(error)}"
            if missing and f"{module}.".startswith(f"{missing}."):  # itself, or its package
                why = (
                    f"there is no module {module!r}; allowed: an installed module, or a file "
                    f"beside the stack file"
                )
            raise LindyError(f"{self._at(name)}: {why}") from error

    def _at(self, name: str) -> str:
        return place(self.file, name, "module")


def own_settings(name: str) -> type | None:
    """The settings that one of Lindy's own services reads from a vehicle file."""
    return getattr(importlib.import_module(f"{HERE}.{name}.core"), "Settings", None)


def wire_of(name: str) -> Wire:
    """`wire` of one of Lindy's own services."""
    return importlib.import_module(f"{HERE}.{name}.service").wire


def _line_in(module: ModuleType | None, error: BaseException) -> traceback.FrameSummary:
    """Where an error came from: the innermost line of the module or of a file beside it, because
    what it called there is seldom at fault; else the innermost line of all."""
    frames = traceback.extract_tb(error.__traceback__)
    file = getattr(module, "__file__", None)
    own = [f for f in frames if file is not None and Path(f.filename).parent == Path(file).parent]
    return (own or frames)[-1]


def _in_words(error: BaseException) -> str:
    return f"{type(error).__name__}: {' '.join(str(error).split())}"
