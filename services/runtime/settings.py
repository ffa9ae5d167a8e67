"""TOML files into frozen Structs. An error names the file, the line, the key, what was found, what
is allowed, and the nearest known key."""

import difflib
import re
import tomllib
from collections.abc import Sequence
from pathlib import Path
from typing import Any, TypeVar, cast

import msgspec

from services.runtime.errors import LindyError

DEPLOY = Path(__file__).resolve().parents[2] / "deploy"
S = TypeVar("S")


def deploy_file(folder: str, name: str, suffix: str = ".toml") -> Path:
    """The file of a named vehicle, link, stack, pad or dive; or `name` itself when it is a path.

    Raises:
        LindyError: there is no such file; says which names there are.
    """
    if name.endswith(suffix):
        if Path(name).is_file():
            return Path(name)
        raise LindyError(f"there is no file {name}")
    path = DEPLOY / folder / f"{name}{suffix}"
    if path.is_file():
        return path
    known = sorted(file.stem for file in (DEPLOY / folder).glob(f"*{suffix}"))
    raise LindyError(f"unknown {folder.rstrip('s')} {name!r}{nearest(name, known)}")


def nearest(found: str, known: Sequence[str]) -> str:
    """`; did you mean 'x'? Known: x, y` for an error about a name."""
    close = difflib.get_close_matches(found, known, n=1)
    guess = f"; did you mean {close[0]!r}?" if close else ";"
    return f"{guess} known: {', '.join(known)}"


def read_toml(path: Path) -> dict[str, Any]:
    """The file as plain dictionaries.

    Raises:
        LindyError: it cannot be read or is not TOML.
    """
    try:
        return tomllib.loads(path.read_text(encoding="utf-8"))
    except OSError as error:
        raise LindyError(f"cannot read {path}: {error.strerror}") from None
    except (tomllib.TOMLDecodeError, UnicodeDecodeError) as error:
        raise LindyError(f"{path}: not valid TOML: {error}") from None


def override(tree: dict[str, Any], assignments: Sequence[str]) -> None:
    """Apply `--set control.depth.kp=3` style assignments in place.

    Raises:
        LindyError: an assignment is malformed or reaches into something that is not a table.
    """
    for assignment in assignments:
        key, equals, text = assignment.partition("=")
        if not equals or not key.strip():
            raise LindyError(f"--set {assignment}: expected key.path=value")
        *path, leaf = key.strip().split(".")
        table = tree
        for part in path:
            inner: Any = table.setdefault(part, {})
            if not isinstance(inner, dict):
                raise LindyError(f"--set {assignment}: {part} is a value, not a table")
            table = cast(dict[str, Any], inner)
        table[leaf] = _value(text.strip())


def convert(tree: Any, kind: type[S], where: str, path: Path | None = None) -> S:
    """A dictionary into the Struct `kind`, unknown keys refused.

    Args:
        where: dotted name of the table inside the file, for the error.
        path: file it came from, for the error.

    Raises:
        LindyError: an unknown key, a wrong type or a value outside its limits.
    """
    try:
        return msgspec.convert(tree, kind)
    except msgspec.ValidationError as error:
        raise LindyError(_explain(str(error), tree, kind, where, path)) from None


def read(path: Path, kind: type[S]) -> S:
    """A whole TOML file into the Struct `kind`."""
    return convert(read_toml(path), kind, "", path)


def _value(text: str) -> Any:
    try:
        return tomllib.loads(f"v = {text}")["v"]
    except tomllib.TOMLDecodeError:
        return text  # a bare word is a string, so that shells need no quotes inside quotes


def _explain(error: str, tree: Any, kind: type, where: str, path: Path | None) -> str:
    what, _, at = error.partition(" - at ")
    steps = re.findall(r"\.(\w+)|\[(\d+)\]", at.strip("`"))
    parts = [name or int(index) for name, index in steps]
    unknown = re.search(r"unknown field `(\w+)`", what)
    key = ".".join([*filter(None, [where]), *map(str, parts), *([unknown[1]] if unknown else [])])
    text = [f"{path}{line_of(path, key)}: " if path else "", f"{key or 'this file'}: "]
    if unknown:
        text.append(f"unknown key{nearest(unknown[1], _fields(kind, parts))}")
    else:
        text.append(what[0].lower() + what[1:].replace("`", ""))
        found = _at(tree, parts)
        if not isinstance(found, dict | list):
            text.append(f", found {found!r}")
    return "".join(text)


def line_of(path: Path, key: str) -> str:
    """`:12` when the last part of the key stands on exactly one line under its table."""
    table, _, leaf = key.rpartition(".")
    inside = table == ""
    for number, line in enumerate(path.read_text(encoding="utf-8").splitlines(), 1):
        if heading := re.match(r"\s*\[+\s*([\w.\-]+)\s*\]+", line):
            inside = re.sub(r"\.\d+", "", table) == heading[1]
        elif inside and re.match(rf"\s*{re.escape(leaf)}\s*=", line):
            return f":{number}"
    return ""


def _at(tree: Any, parts: list[Any]) -> Any:
    for part in parts:
        try:
            tree = tree[part]
        except (KeyError, IndexError, TypeError):
            return {}
    return tree


def _fields(kind: Any, parts: list[Any]) -> list[str]:
    """Names a Struct knows at the end of a path of keys."""
    node = msgspec.inspect.type_info(kind)
    for part in parts:
        if isinstance(node, msgspec.inspect.StructType):
            node = next((f.type for f in node.fields if f.encode_name == part), node)
        elif isinstance(node, msgspec.inspect.DictType):
            node = node.value_type
        elif isinstance(
            node,
            msgspec.inspect.ListType | msgspec.inspect.VarTupleType,
        ):
            node = node.item_type
    return (
        sorted(f.encode_name for f in node.fields)
        if isinstance(node, msgspec.inspect.StructType)
        else []
    )
