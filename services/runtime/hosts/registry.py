"""The services of a stack: what is asked of them as a whole.

The stack file is read and checked in `stack_file`, and the code of a service is found in
`service_module`.
"""

from collections.abc import Collection, Iterator, Mapping
from dataclasses import dataclass, replace
from pathlib import Path

import msgspec

from messages import topics
from messages.topic import AnyTopic
from services.runtime.config.errors import LindyError
from services.runtime.config.settings import deploy_file
from services.runtime.config.stack import Role
from services.runtime.hosts.stack_file import (
    ONE_EACH,
    ServiceModule,
    ServiceSpec,
    Wire,
    code_of,
    module_of,
    own_services,
    own_settings,
    place,
    read_specs,
    require_one_of_a_kind,
    require_possible,
    require_processes,
)

DEFAULT = "simulated"  # the stack of a dive without --stack
SHARED = {"topside": "topside", "drone": "onboard"}  # process of each side with --grouped
# What somebody must publish in a dive, and which of Lindy's own services does.
NEEDED: dict[str, AnyTopic] = {
    "gamepad": topics.PILOT_COMMAND,
    "estimation": topics.STATE,
    "reference": topics.REFERENCE,
    "control": topics.THRUSTERS,
}
OF_ONE = (topics.ACTUATION, *(NEEDED[own] for own in ONE_EACH))
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
        specs = read_specs(file)
        registry = cls(file.resolve(), specs)
        require_possible(specs, registry.file)
        require_processes(specs, registry.file)
        if not registry.vehicle_side:
            raise LindyError(
                f"{file}: no service is the vehicle; one of them must have vehicle_side = true"
            )
        require_one_of_a_kind(specs, registry.file)
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
        return {n: self._module(n).name for n, spec in self.specs.items() if spec.vehicle_side}

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
            LindyError: names what nobody publishes, or two of which there may be one only.
        """
        everything = {topic for own in published.values() for topic in own}
        if missing := [own for own, topic in NEEDED.items() if topic not in everything]:
            raise self._unpublished(missing)
        for topic in OF_ONE:
            names = [name for name, own in published.items() if topic in own]
            if len(names) > 1:
                raise LindyError(
                    f"{place(self.file, names[1])}: it publishes {topic.key}, and so does "
                    f"{names[0]}; allowed is one"
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
        grouped = {
            name: msgspec.structs.replace(spec, process=spec.process or SHARED[spec.sides[0]])
            for name, spec in self.specs.items()
        }
        require_processes(grouped, self.file)
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
        return self._module(name).wire()

    def failure(self, name: str, error: BaseException) -> LindyError:
        """What a handler of a service raised in mid-dive, in one sentence: which service, which
        module, which line."""
        return self._module(name).failure(error)

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
                found[name] = self._module(name).settings_of_users() if at_home else dict
        return found

    def _module(self, name: str) -> ServiceModule:
        return module_of(name, self.specs[name], self.file)
