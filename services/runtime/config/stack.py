"""What every service of one dive shares: the vehicle, the link, the pilot, where files go."""

import re
from collections.abc import Mapping, Sequence
from contextlib import suppress
from functools import cached_property
from pathlib import Path
from typing import Annotated, Any, Literal, TypeVar, cast

import msgspec

from services.runtime.config.errors import LindyError
from services.runtime.config.settings import (
    DEPLOY,
    convert,
    deploy_file,
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
SENSORS = "sensors"  # its table that names parts, and the folder of these in deploy/


class NamedSensors(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """The table [sensors] of a vehicle file: names in deploy/sensors, or own part files, in which a
    part's figures stand once for every vehicle that has it."""

    imu: str | None = None
    magnetometer: str | None = None
    pressure: str | None = None
    dvl: str | None = None


class SensorPart(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """A part file. Its tables lie under those of the vehicle file, so that what is stated there, or
    by `--set`, counts."""

    kind: str  # a key of [sensors]
    simulator: dict[str, Any] = {}
    estimation: dict[str, Any] = {}


class NamedVehicle(msgspec.Struct):
    """What a vehicle file calls its vehicle."""

    name: str


class Stack(msgspec.Struct, frozen=True, kw_only=True, dict=True):
    """The settings of one dive, as given on the command line."""

    vehicle: str = "pioneer"
    name: str = ""  # of this drone on the network; empty: that of its type
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
        """Name of the type of vehicle in keys, [a-z0-9_]: what its file calls it, such as
        `bluerov2_heavy` of a "BlueROV2 Heavy"; where no such letter is in it, `vehicle`.

        Raises:
            LindyError: its file cannot be read, or does not name it.
        """
        table = self._own_tree.get("vehicle", {})
        named = convert(table, NamedVehicle, "vehicle", self.vehicle_path)
        return re.sub(r"[^a-z0-9]+", "_", named.name.lower()).strip("_") or "vehicle"

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
            LindyError: as `vehicle_name`, where it has no name of its own.
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
        files = [self.vehicle_path, *self._part_paths]
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
        try:
            return convert(self._tree.get(name, {}), kind, name, self.vehicle_path)
        except LindyError:
            for part in self._part_paths:  # is it this one's mistake?
                if said := getattr(read_part(part), name, {}):
                    convert(said, kind, name, part)
            self._blame_option(name, kind)
            raise

    def check(self, known: Mapping[str, type | None], *, recorded: bool = False) -> None:
        """Read every table of the vehicle file once, so that a mistake stops a dive before it
        starts.

        Args:
            known: the tables that are allowed, and the type each is read into; None: that of a
                service whose module declares no settings.
            recorded: the vehicle file is of a recording: its tables for services that are not here
                are passed over.

        Raises:
            LindyError: an unknown table, or a mistake in one.
        """
        others = read_toml(self.vehicle_path) if recorded else {}
        for name in self._own_tree:
            if known.get(name) is None and name not in others:
                allowed = sorted(name for name, kind in known.items() if kind is not None)
                hint = LINK if name == "link" else nearest(name, allowed)
                what = f"unknown table of a vehicle file for the stack {self.services}{hint}"
                raise self.mistake((name,), NO_SETTINGS if name in known else what)
        for name, kind in known.items():
            if kind is not None:
                self.section(name, kind)

    @property
    def tables(self) -> set[str]:
        """Names of the tables of the vehicle file, with those of its sensors' part files.

        Raises:
            LindyError: a file cannot be read, or a sensor does not exist.
        """
        return {*self._tree}

    def mistake(self, key: tuple[str, ...], why: str) -> LindyError:
        """The error for a key of the vehicle file, or for the `--set` that it came from."""
        path, words = self.vehicle_path, ".".join(key)
        in_file = line_of(path, key, exact=True)
        for assignment in reversed(self.overrides):
            option = assignment.partition("=")[0].strip()
            if option == words:
                return LindyError(f"--set {assignment}: {why}")
            inside = option.startswith(f"{words}.") and not in_file
            if inside or words.startswith(f"{option}."):
                return LindyError(f"--set {assignment}: {words}: {why}")
        return LindyError(f"{path}{line_of(path, key)}: {words}: {why}")

    @cached_property
    def _own_tree(self) -> dict[str, Any]:
        """The vehicle file without what its sensors' part files say."""
        tree = read_toml(self.vehicle_path)
        override(tree, self.overrides)
        return tree

    @cached_property
    def _tree(self) -> dict[str, Any]:
        """The vehicle file with the figures of its parts where it states none itself."""
        return _with_parts(self._own_tree, self._part_paths)

    @cached_property
    def _part_paths(self) -> list[Path]:
        """
        Raises:
            LindyError: a sensor that the vehicle file names does not exist, or is of another kind.
        """
        paths = list[Path]()
        try:
            table = self._own_tree.get(SENSORS, {})
            named = convert(table, NamedSensors, SENSORS, self.vehicle_path)
        except LindyError:
            self._blame_option(SENSORS, NamedSensors, parts=False)
            raise
        for kind, name in msgspec.structs.asdict(named).items():
            try:
                paths += [part_path(kind, name)] if name is not None else []
            except LindyError as error:
                raise self.mistake((SENSORS, kind), str(error)) from None
        return paths

    def _blame_option(self, name: str, kind: type, *, parts: bool = True) -> None:
        """Of a table that is wrong: is it an option's mistake?

        Raises:
            LindyError: the `--set` from which on it is wrong, and why; else it is the file's.
        """
        paths, why = self._part_paths if parts else [], ""
        for number in range(len(self.overrides), -1, -1):
            tree = read_toml(self.vehicle_path)
            override(tree, self.overrides[:number])
            try:
                convert(_with_parts(tree, paths).get(name, {}), kind, name)
            except LindyError as error:
                why = why or str(error)
                continue
            guilty = self.overrides[number]
            key = guilty.partition("=")[0].strip()
            raise LindyError(f"--set {guilty}: {why.removeprefix(f'{key}: ')}") from None


def read_part(path: Path) -> SensorPart:
    """Raises LindyError: it cannot be read, or is no part file."""
    return convert(read_toml(path), SensorPart, "", path)


def part_path(kind: str, name: str) -> Path:
    """The file of a part that a vehicle file names as its sensor of this kind.

    Raises:
        LindyError: there is no such part, or it is a sensor of another kind.
    """
    parts = {each.stem: each for each in sorted((DEPLOY / SENSORS).glob("*.toml"))}
    path = deploy_file(SENSORS, name) if name.endswith(".toml") or "/" in name else parts.get(name)
    found = None if path is None else read_part(path).kind
    if path is not None and found == kind:
        return path
    known = [stem for stem, each in parts.items() if read_part(each).kind == kind]
    if found is None:
        raise LindyError(f"unknown part {name!r}{nearest(name, known)}")
    raise LindyError(f"{name!r} is of the kind {found!r}; known: {', '.join(known)}")


def _with_parts(tree: dict[str, Any], paths: Sequence[Path]) -> dict[str, Any]:
    for path in paths:
        part = read_part(path)
        tree = _under(tree, {"simulator": part.simulator, "estimation": part.estimation})
    return tree


def _under(above: dict[str, Any], below: dict[str, Any]) -> dict[str, Any]:
    """Both, table by table; where both have a value, that of `above`."""
    together = {**below, **above}
    for name in above.keys() & below.keys():
        if isinstance(above[name], dict) and isinstance(below[name], dict):
            together[name] = _under(
                cast(dict[str, Any], above[name]), cast(dict[str, Any], below[name])
            )
    return together
