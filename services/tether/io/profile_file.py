"""Link profiles: read from files, or changed key by key."""

import copy
import csv
from collections.abc import Sequence
from pathlib import Path
from typing import Any, cast

from messages.link import LinkRequest
from services.runtime.config.errors import LindyError
from services.runtime.config.settings import (
    convert,
    deploy_file,
    nearest,
    override,
    read_text,
    read_toml,
)
from services.tether.profile import LinkProfile, Named, Trace

KINDS = ["pareto", "table", "trace"]  # of a delay
Tree = dict[str, Any]


def named(name: str) -> Named:
    """A profile of deploy/links, or a TOML file.

    Raises:
        LindyError: there is none of that name, or a mistake in it or in its trace.
    """
    path = deploy_file("links", name)
    tree = read_toml(path)
    return Named(name, tree, path, _checked(tree, path))


def traces(profile: Named) -> list[Path]:
    """The files of the delays that it has read."""
    legs = [profile.tree.get(side) for side in ("down", "up")]
    delays = [cast(Tree, leg).get("delay") for leg in legs if isinstance(leg, dict)]
    named = [cast(Tree, delay) for delay in delays if isinstance(delay, dict)]
    files = [profile.path.parent / str(delay["file"]) for delay in named if "file" in delay]
    return [*dict.fromkeys(files)]


def asked_for(request: LinkRequest, in_force: Named) -> tuple[Named, str] | str:
    """The new profile and what changes, in words; or why the request is refused."""
    try:
        if request.kind == "set":
            return adjusted(in_force, request.settings)
        if request.profile is None:
            return "no profile is named"
        after = named(request.profile)
    except LindyError as error:
        return str(error)
    return after, f"profile {in_force.name} → {after.name}"


def adjusted(before: Named, settings: Sequence[str]) -> tuple[Named, str]:
    """The profile with `up.delay_ms=80` style settings applied, and what has changed, in words.

    Raises:
        LindyError: a setting is malformed, unknown or outside its limits.
    """
    if not settings:
        raise LindyError("nothing to set; expected key=value, for example up.delay_ms=80")
    tree = copy.deepcopy(before.tree)
    try:
        override(tree, settings)
    except LindyError as error:
        raise LindyError(str(error).removeprefix("--set ")) from None
    after = before._replace(tree=tree, profile=_checked(tree, None, before.path.parent))
    keys = dict.fromkeys(setting.partition("=")[0].strip() for setting in settings)
    changes = [f"{key} {_at(before.tree, key)} → {_at(tree, key)}" for key in keys]
    return after, ", ".join(changes)


def _checked(tree: Tree, path: Path | None, folder: Path | None = None) -> LinkProfile:
    """The tree as a profile, its traces read."""
    tree = copy.deepcopy(tree)
    for side in ("down", "up"):
        leg = tree.get(side)
        if not isinstance(leg, dict):
            continue
        spread = cast(Tree, leg).get("delay")
        kind = cast(Tree, spread).get("kind") if isinstance(spread, dict) else KINDS[0]
        if kind not in KINDS:
            before = f"{path}: " if path else ""
            raise LindyError(
                f"{before}{side}.delay.kind: unknown kind {kind!r}{nearest(str(kind), KINDS)}"
            )
        _read_trace(cast(Tree, leg), folder or (path or Path()).parent)
    return convert(tree, LinkProfile, "", path)


def _read_trace(leg: Tree, folder: Path) -> None:
    table = leg.get("delay")
    if isinstance(table, dict) and "file" in table:
        trace = cast(Tree, table)
        path = folder / str(trace["file"])
        trace["sent_s"], trace["arrived_s"] = read_trace(path)
        convert(trace, Trace, "", path)  # so that an error names the trace file


def read_trace(path: Path) -> tuple[list[float], list[float | None]]:
    """Columns sent_s and arrived_s of a trace; lines that begin with # are comments.

    Raises:
        LindyError: it cannot be read or is not such a file; says where.
    """
    lines = read_text(path).splitlines()
    sent: list[float] = []
    arrived: list[float | None] = []
    for number, cells in enumerate(csv.reader(lines), 1):
        if not cells or cells[0].startswith("#") or cells == ["sent_s", "arrived_s"]:
            continue
        try:
            begin, end = cells
            sent.append(float(begin))
            arrived.append(float(end) if end else None)
        except ValueError:
            raise LindyError(
                f"{path}:{number}: expected sent_s,arrived_s, found {','.join(cells)!r}"
            ) from None
    if not sent:
        raise LindyError(f"{path} holds no rows; expected lines sent_s,arrived_s")
    return sent, arrived


def _at(tree: Any, key: str) -> str:
    for part in key.split("."):
        tree = cast(Tree, tree).get(part) if isinstance(tree, dict) else None
    return "unset" if tree is None else str(tree)
