"""TOML files into frozen Structs. An error names the file, the line, the key, what was found, what
is allowed, and the nearest known key."""

import copy
import difflib
import inspect
import os
import re
import tomllib
from collections import Counter
from collections.abc import Generator, Mapping, Sequence
from contextlib import contextmanager, suppress
from functools import lru_cache
from pathlib import Path
from typing import Any, TypeVar, cast

import msgspec

from services.runtime.config.errors import LindyError

DEPLOY = Path(__file__).resolve().parents[3] / "deploy"
S = TypeVar("S")
_copies: dict[str, str] = {}  # file → copy that is read in its place
Key = tuple[str | int, ...]  # names, and indices of entries in arrays, from 0
HEADING = re.compile(r"\s*(\[\[?)([\w.\-\"' ]+)\]\]?\s*(#.*)?$")
QUOTES = ('"""', "'''")  # of strings of several lines
ASSIGNMENT = re.compile(r"\s*([\w.\-]+)\s*=")
LARGEST_FILE = 50_000_000  # [bytes] a trace of many hours
LONGEST_TOML = 1_000_000  # [letters] a vehicle file has 20,000
PLAIN = {  # types as msgspec calls them
    "float": "a number",
    "int": "a whole number",
    "str": "text",
    "bool": "true or false",
    "array": "an array",
    "object": "a table",
    "null": "nothing",
}
UNNAMED = "[...]"  # of msgspec, for a name in a dictionary


def deploy_file(folder: str, name: str, suffix: str = ".toml") -> Path:
    """The file of a named vehicle, link, stack, pad or dive; or `name` itself when it is a path.

    Raises:
        LindyError: there is no such file; lists the known names.
    """
    if name.endswith(suffix):
        if _is_file(Path(name)):
            return Path(name)
        there = os.path.lexists(name)
        raise LindyError(f"{name} is no file" if there else f"there is no file {name}")
    if "/" in name:
        raise LindyError(
            f"{name} is no {suffix} file: give a name in deploy/{folder} or such a file"
        )
    path = DEPLOY / folder / f"{name}{suffix}"
    if _is_file(path):
        return path
    known = sorted(file.stem for file in (DEPLOY / folder).glob(f"*{suffix}"))
    raise LindyError(f"unknown {folder.rstrip('s')} {name!r}{nearest(name, known)}")


@contextmanager
def reading_copies(copies: Mapping[str, str]) -> Generator[None]:
    """Meanwhile read these files from copies, whatever has become of them: a service that starts
    again in mid-dive begins with what the others began with."""
    _copies.update(copies)
    try:
        yield
    finally:
        _copies.clear()


def kept(path: Path) -> Path:
    """Where to read a file: its copy, if there is one now, or the file itself."""
    return Path(_copies.get(str(path), path))


def _is_file(path: Path) -> bool:
    try:
        return kept(path).is_file()
    except OSError:  # a name longer than the operating system allows
        return False


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
        return parsed_toml(read_text(path))
    except ValueError as error:
        raise LindyError(f"{path}: not valid TOML: {error}") from None


def parsed_toml(text: str) -> dict[str, Any]:
    """TOML, parsed once in this process however often it is asked for.

    Raises:
        ValueError: it is not TOML, too long or too deep.
    """
    return copy.deepcopy(_parsed(text))


@lru_cache(maxsize=32)
def _parsed(text: str) -> dict[str, Any]:
    if len(text) > LONGEST_TOML:
        raise ValueError(f"{len(text)} letters, at most {LONGEST_TOML} are allowed")
    try:
        return tomllib.loads(text)
    except RecursionError:
        raise ValueError("tables or arrays too deep") from None


def read_text(path: Path) -> str:
    """A whole text file.

    Raises:
        LindyError: it cannot be read or is not text.
    """
    try:
        # Editors on Windows begin a file with a mark and end a line with two letters.
        return read_whole(path).decode("utf-8-sig").replace("\r\n", "\n")
    except UnicodeDecodeError:
        raise LindyError(f"cannot read {path}: it is not text") from None


def read_whole(path: Path) -> bytes:
    """Only a regular file of at most `LARGEST_FILE`, because a name can come from another machine,
    and a device may have no end.

    Raises:
        LindyError: it cannot be read.
    """
    place = kept(path)
    try:
        if place.exists() and not place.is_file():
            raise LindyError(f"cannot read {path}: not a regular file")
        if (size := place.stat().st_size) > LARGEST_FILE:
            most = LARGEST_FILE // 10**6
            raise LindyError(f"cannot read {path}: {size // 10**6} MB, at most {most} are allowed")
        return place.read_bytes()
    except OSError as error:
        raise LindyError(f"cannot read {path}: {error.strerror}") from None


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
        try:
            table[leaf] = _value(text.strip())
        except ValueError as error:
            raise LindyError(f"--set {assignment}: {error}") from None


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
        found = _with_name(str(error), tree, kind)
        raise LindyError(_explain(found, tree, kind, where, path)) from None


def read(path: Path, kind: type[S]) -> S:
    """A whole TOML file into the Struct `kind`."""
    return convert(read_toml(path), kind, "", path)


def _value(text: str) -> Any:
    """Raises ValueError: neither TOML nor a bare word."""
    try:
        return tomllib.loads(f"v = {text}")["v"]
    except RecursionError:
        raise ValueError("not valid TOML (arrays or tables too deep)") from None
    except ValueError as error:  # not TOML, or a number of thousands of digits
        if not text.startswith(("[", "{", '"', "'")) and not _is_number(text):
            return text  # a bare word is a string, so that shells need no quotes inside quotes
        why = str(error).partition(" (at")[0].lower()
        raise ValueError(f"not valid TOML ({why}); a number looks like 0.38") from None


def _is_number(text: str) -> bool:
    try:
        float(text)
    except ValueError:
        return False
    return True


def _explain(error: str, tree: Any, kind: type, where: str, path: Path | None) -> str:
    what, _, at = error.partition(" - at ")
    steps = re.findall(r"\.(\w+)|\[(\d+)\]", at.strip("`"))
    parts: Key = tuple(name or int(index) for name, index in steps)
    unknown = re.search(r"unknown field `(\w+)`", what)
    key = (*filter(None, where.split(".")), *parts, *([unknown[1]] if unknown else []))
    line = line_of(path, key, exact=bool(unknown)) if path else ""
    text = [f"{path}{line}: " if path else "", f"{in_words(key) or 'this file'}: "]
    missing = re.fullmatch(r"Object missing required field `(\w+)`", what)
    known = _fields(kind, list(parts))
    found = _at(tree, list(parts))
    if unknown:
        text.append(f"unknown key{nearest(unknown[1], known)}")
    elif missing:
        text.append(f"the key {missing[1]} is missing; known: {', '.join(known)}")
    elif what.startswith("Expected `object") and known:
        text.append(f"expected a table, found {found!r}; its keys: {', '.join(known)}")
    else:
        what, got, kind_found = what.partition(", got ")
        text.append(_plainly(what[0].lower() + what[1:]))
        if re.search(r"` [<>]=? \S+$", what):  # a limit, which a number alone does not tell
            text.append(_unit(kind, list(parts)))
        if not isinstance(found, dict | list):
            text.append(f", found {found!r}")
        elif got:
            text.append(f", found {_plainly(kind_found)}")
    return "".join(text)


def _plainly(words: str) -> str:
    """What msgspec says, without names of types."""
    without = words.replace(" | null", "")
    return re.sub(r"`(\w*)([^`]*)`", lambda m: PLAIN.get(m[1], m[1]) + m[2], without)


def _with_name(error: str, tree: Any, kind: type) -> str:
    """An error inside a table of tables with names of the user's own, which msgspec does not name:
    with the name of the table that alone gives the same error."""
    before, unnamed, _ = error.partition(UNNAMED)
    parts = re.findall(r"\.(\w+)", before.rpartition(" - at ")[2])
    tables = _at(tree, parts)
    if not unnamed or not isinstance(tables, dict):
        return error
    for name, table in cast(dict[str, Any], tables).items():
        try:
            msgspec.convert(_replaced(tree, parts, {name: table}), kind)
        except msgspec.ValidationError as again:
            if str(again) == error:
                return error.replace(UNNAMED, f".{name}", 1)
    return error


def _replaced(tree: Any, parts: Sequence[str], value: Any) -> Any:
    if not parts:
        return value
    return {**tree, parts[0]: _replaced(tree[parts[0]], parts[1:], value)}


def in_words(key: Key) -> str:
    """Names with dots between them; the entries of an array are counted from 1, as people do."""
    text = ""
    for part, before in zip(key, (None, *key), strict=False):
        if isinstance(part, int):
            text += f"{',' if isinstance(before, int) else ''} number {part + 1}"
        elif isinstance(before, int):
            text += f", {part}"
        else:
            text += f".{part}" if text else part
    return text


def line_of(path: Path, key: Key, *, exact: bool = False) -> str:
    """`:12` where a key stands in a TOML file; of a key that is missing, unless `exact`, the line
    of the nearest table or array around it. Empty when there is none, or the file has gone."""
    try:
        lines = _lines(kept(path).read_text(encoding="utf-8"))
    except OSError:
        return ""
    for length in range(len(key), 0, -1):
        if (number := lines.get(key[:length])) is not None:
            return f":{number}"
        if exact:
            break
    return ""


def _lines(text: str) -> dict[Key, int]:
    """Line of every table and key; entries of an array of tables count from 0."""
    lines: dict[Key, int] = {}
    entries: Counter[Key] = Counter()
    table: Key = ()
    inside = ""  # quotes at which the string ends that began on an earlier line
    for number, line in enumerate(text.splitlines(), 1):
        if inside:
            inside = "" if inside in line else inside
        elif heading := HEADING.match(line):
            table = _resolved(heading[2], entries, array=len(heading[1]) == 2)
            for length in range(1, len(table) + 1):
                lines.setdefault(table[:length], number)
        elif assignment := ASSIGNMENT.match(line):
            lines.setdefault((*table, *assignment[1].split(".")), number)
            inside = next((quotes for quotes in QUOTES if line.count(quotes) == 1), "")
    return lines


def _resolved(heading: str, entries: Counter[Key], *, array: bool) -> Key:
    """A heading as a key; of an array of tables the entry that the heading begins or is in."""
    key: Key = ()
    names = [name.strip(" \t\"'") for name in heading.split(".")]
    for depth, name in enumerate(names, 1):
        key = (*key, name)
        if array and depth == len(names):
            entries[key] += 1
        if entries[key]:
            key = (*key, entries[key] - 1)
    return key


def _at(tree: Any, parts: list[Any]) -> Any:
    for part in parts:
        try:
            tree = tree[part]
        except (KeyError, IndexError, TypeError):
            return {}
    return tree


def _fields(kind: Any, parts: list[Any]) -> list[str]:
    """Names a Struct knows at the end of a path of keys."""
    node = _node(kind, parts)
    known = node.fields if isinstance(node, msgspec.inspect.StructType) else ()
    return sorted(field.encode_name for field in known)


def _unit(kind: Any, parts: list[Any]) -> str:
    """` m/s²` of a field, from the comment at it; empty: it has none, or no source is here."""
    while parts and not isinstance(parts[-1], str):
        parts = parts[:-1]
    node = _node(kind, parts[:-1])
    if not parts or not isinstance(node, msgspec.inspect.StructType):
        return ""
    for owner in node.cls.__mro__:
        with suppress(OSError, TypeError):
            source = inspect.getsource(owner)
            comments = r"((?:^ +#.*\n)*)"
            field = re.search(rf"{comments}^    {parts[-1]}:(.*(?:\n    [ )\]].*)*)", source, re.M)
            if field is not None:
                unit = re.search(r"# \[([^\]]+)\]", f"{field[2]}\n{field[1]}")
                return f" {unit[1]}" if unit is not None and unit[1] != "-" else ""
    return ""


def _node(kind: Any, parts: list[Any]) -> msgspec.inspect.Type:
    """What is expected at the end of a path of keys."""
    node = _table(msgspec.inspect.type_info(kind))
    for part in parts:
        if isinstance(node, msgspec.inspect.StructType):
            node = next((f.type for f in node.fields if f.encode_name == part), node)
        elif isinstance(node, msgspec.inspect.DictType):
            node = node.value_type
        elif isinstance(node, msgspec.inspect.ListType | msgspec.inspect.VarTupleType):
            node = node.item_type
        node = _table(node)
    return node


def _table(node: msgspec.inspect.Type) -> msgspec.inspect.Type:
    """Of what may be absent, or a table or a word, that which has keys or entries."""
    if not isinstance(node, msgspec.inspect.UnionType):
        return node
    inner = (msgspec.inspect.StructType, msgspec.inspect.DictType, msgspec.inspect.ListType)
    return next((kind for kind in node.types if isinstance(kind, inner)), node)
