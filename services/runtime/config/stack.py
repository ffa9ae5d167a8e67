"""What every service of one dive shares: the vehicle, the link, the pilot, where files go."""

import re
from collections.abc import Mapping
from contextlib import suppress
from functools import cached_property, lru_cache
from pathlib import Path
from typing import Annotated, Any, Literal, TypeVar

import msgspec

from services.runtime.config.errors import LindyError
from services.runtime.config.sensor_parts import (
    SENSORS,
    NamedSensors,
    part_path,
    read_part,
    with_parts,
)
from services.runtime.config.settings import (
    convert,
    deploy_file,
    kept,
    line_of,
    nearest,
    override,
    read_toml,
)

S = TypeVar("S")
# What a service is watched for: the motion depends on it, it starts the others again, it records,
# it compares the clocks.
Role = Literal["motion", "keeper", "recorder", "clock"]
NO_SETTINGS = (
    "the module of this service has no settings; declare them in it as "
    "class Settings(msgspec.Struct, frozen=True, forbid_unknown_fields=True)"
)
LINK = "; the link is in the file of --link, and `lindy link set` changes it while a dive goes on"
SCRIPT = "script:"  # of a pilot: then comes its name
# A replay's own part of the keys. Wildcards do not match a chunk that begins with @, and no vehicle
# can have such a name: docs/decisions.md (0018).
REPLAY = "@replay"
BODY = "vehicle"  # the table of the vehicle file that describes the vehicle itself


class Stack(msgspec.Struct, frozen=True, kw_only=True, dict=True):
    """The settings of one dive, as given on the command line."""

    vehicle: str = "pioneer"
    name: str = ""  # of this drone on the network; empty: that of its file
    link: str = "tether"
    pilot: str = "gamepad"  # gamepad, keyboard or script:FILE
    out: str = "."  # folder for recordings
    seed: Annotated[int, msgspec.Meta(ge=0)] = 0
    viewer: bool = False  # open a live viewer
    apart: bool = False  # topside and drone are two machines, each with its own clock
    insecure: bool = False  # other machines are let in without keys
    virtual: bool = False  # on virtual time: a driver that needs real time refuses to start
    services: str = "simulated"  # a name in deploy/stacks, or the path of a TOML file
    running: list[str] = []  # services of it that take part; empty: all
    seconds: float | None = None  # [s] end this long after arming; None: when the pilot ends it
    watched: dict[str, Role] = {}  # services that the failsafes watch, and for what
    read_besides: list[str] = []  # files that those of vehicle, link and pilot name
    replay: bool = False  # shows a recorded dive that is played again, and no vehicle
    overrides: list[str] = []  # key.path=value into the vehicle file

    @cached_property
    def vehicle_path(self) -> Path:
        return deploy_file("vehicles", self.vehicle)

    @property
    def vehicle_name(self) -> str:
        """Name of the type of vehicle, by its file: [a-z0-9_].

        Raises:
            LindyError: its file has a name that is not allowed in a key.
        """
        name = self.vehicle_path.stem.lower().replace("-", "_")
        if re.fullmatch(r"[a-z0-9_]+", name) is None:
            raise LindyError(
                f"{self.vehicle_path}: the file's name is the vehicle's name in every key, so it "
                f"may have letters a to z, digits, '_' and '-' only, found "
                f"{self.vehicle_path.stem!r}; rename the file"
            )
        return name

    @property
    def space(self) -> str:
        """What the keys of this dive begin with: the drone's name; of a replay one that no
        vehicle can have.

        Raises:
            LindyError: as `vehicle_name`.
        """
        return f"{REPLAY}/{self.vehicle_name}" if self.replay else self.drone_name

    @property
    def drone_name(self) -> str:
        """Name of this drone on the network: two of one type have two names.

        Raises:
            LindyError: it has no name of its own, and its file's cannot be one.
        """
        return self.name or self.vehicle_name

    @property
    def files(self) -> list[Path]:
        """What services read when they start: the files of the vehicle, its sensors, the link and
        the script, and those that these name.

        Raises:
            LindyError: there is no such vehicle, or no such sensor.
        """
        wanted = [("links", self.link, ".toml")]
        if self.pilot.startswith(SCRIPT):
            wanted.append(("dives", self.pilot.removeprefix(SCRIPT), ".csv"))
        files = [self.vehicle_path, *self._part_paths()]
        for folder, name, suffix in wanted:
            with suppress(LindyError):  # nobody on this side may read it
                files.append(deploy_file(folder, name, suffix))
        return [*dict.fromkeys([*files, *map(Path, self.read_besides)])]

    @property
    def out_dir(self) -> Path:
        return Path(self.out)

    def section(self, name: str, kind: type[S]) -> S:
        """One table of the vehicle file, with the overrides applied.

        Raises:
            LindyError: the table is wrong; says where and what is allowed.
        """
        path, parts = self.vehicle_path, self._part_paths()
        tree = _with_parts(path, tuple(self.overrides), *_copied(path, *parts))
        try:
            return convert(tree.get(name, {}), kind, name, path)
        except LindyError as error:
            for part in parts:  # is it this one's mistake?
                if said := getattr(read_part(part), name, {}):
                    convert(said, kind, name, part)
            raise self._blamed(str(error), self._begun(name, kind)) from None

    def body_now(self) -> dict[str, Any]:
        """The table [vehicle] as a service that starts now reads it, whatever was read before.

        Raises:
            LindyError: the file cannot be read.
        """
        tree = read_toml(self.vehicle_path)
        override(tree, self.overrides)
        return tree.get(BODY, {})

    def check(self, known: Mapping[str, type | None], *, recorded: bool = False) -> None:
        """Read every table of the vehicle file once, so that a mistake stops a dive before it
        starts.

        Args:
            known: the tables that are allowed, and the type each is read into; None: that of a
                service whose module declares no settings.
            recorded: the vehicle file is of a recording: its tables for services that are not here
                are passed over.

        Raises:
            LindyError: an unknown table, a mistake in one, or a name that is not allowed in a key.
        """
        _ = self.vehicle_name
        others = read_toml(self.vehicle_path) if recorded else {}
        for name in self._vehicle_tree():
            if known.get(name) is None and name not in others:
                where = f"{self.vehicle_path}{line_of(self.vehicle_path, (name,))}: {name}"
                if name in known:
                    raise self._blamed(f"{where}: {NO_SETTINGS}")
                allowed = sorted(name for name, kind in known.items() if kind is not None)
                hint = LINK if name == "link" else nearest(name, allowed)
                what = f"unknown table of a vehicle file for the stack {self.services}"
                raise self._blamed(f"{where}: {what}{hint}")
        for name, kind in known.items():
            if kind is not None:
                self.section(name, kind)

    @property
    def tables(self) -> set[str]:
        """Names of the tables of the vehicle file, with those of its sensors' part files.

        Raises:
            LindyError: a file cannot be read, or a sensor does not exist.
        """
        path = self.vehicle_path
        return {*_with_parts(path, tuple(self.overrides), *_copied(path, *self._part_paths()))}

    def _vehicle_tree(self) -> dict[str, Any]:
        """The vehicle file without what its sensors' part files say."""
        return _vehicle_tree(self.vehicle_path, tuple(self.overrides), *_copied(self.vehicle_path))

    def _part_paths(self) -> list[Path]:
        """
        Raises:
            LindyError: a sensor that the vehicle file names does not exist, or is of another kind.
        """
        path, paths = self.vehicle_path, list[Path]()
        try:
            named = convert(self._vehicle_tree().get(SENSORS, {}), NamedSensors, SENSORS, path)
        except LindyError as error:
            raise self._blamed(str(error)) from None
        for kind, name in msgspec.structs.asdict(named).items():
            try:
                paths += [part_path(kind, name)] if name is not None else []
            except LindyError as error:
                raise self.mistake((SENSORS, kind), str(error)) from None
        return paths

    def mistake(self, key: tuple[str, str], why: str) -> LindyError:
        """The error for a key of the vehicle file, or for the `--set` that it came from."""
        path = self.vehicle_path
        return self._blamed(f"{path}{line_of(path, key)}: {'.'.join(key)}: {why}")

    def _begun(self, name: str, kind: type) -> str:
        """The `--set` from which on a table is wrong; empty: the file itself is."""
        path, parts = self.vehicle_path, self._part_paths()
        for number in range(len(self.overrides) + 1):
            said = tuple(self.overrides[:number])
            try:
                convert(_with_parts(path, said, *_copied(path, *parts)).get(name, {}), kind, name)
            except LindyError:
                return said[-1] if said else ""
        return ""

    def _blamed(self, sentence: str, begun: str = "") -> LindyError:
        """The error; about a key that came from `--set` it names that option, not the file.

        Args:
            begun: the option from which on the table is wrong, if it is known.
        """
        about = re.fullmatch(
            rf"{re.escape(str(self.vehicle_path))}(:\d+)?: ([^:]+): (.*)", sentence
        )
        if about is None:
            return LindyError(sentence)
        in_file, wrong, why = about.groups()
        for assignment in self.overrides:
            key = assignment.partition("=")[0].strip()
            if key == wrong:
                return LindyError(f"--set {assignment}: {why}")
            inside = wrong.startswith((f"{key}.", f"{key} "))  # of the table or array it sets
            its = assignment == begun or ("unknown" in why and not in_file)
            if inside or (key.startswith(f"{wrong}.") and its):
                return LindyError(f"--set {assignment}: {wrong}: {why}")
        return LindyError(sentence)


def _copied(*paths: Path) -> tuple[tuple[Path, Path], ...]:
    """Each file, and the copy that is read in its place now, if there is one."""
    return tuple((path, kept(path)) for path in paths)


@lru_cache
def _vehicle_tree(path: Path, overrides: tuple[str, ...], *_: tuple[Path, Path]) -> dict[str, Any]:
    """`_`: see `_copied`."""
    tree = read_toml(path)
    override(tree, overrides)
    return tree


@lru_cache
def _with_parts(
    path: Path, overrides: tuple[str, ...], *files: tuple[Path, Path]
) -> dict[str, Any]:
    """`files`: of the vehicle and its sensors, see `_copied`."""
    tree = _vehicle_tree(path, overrides, files[0])
    return with_parts(tree, [part for part, _ in files[1:]])
