"""Which messages of a log a map takes: pure."""

from collections.abc import Mapping, Sequence
from fnmatch import fnmatchcase

from services.runtime.config.errors import LindyError
from tools.importing.log_file import LogSource
from tools.importing.map_file import TARGETS, ImportMap, TakenMessage

SHOWN = 12  # sources of a log that a sentence lists


def chosen(
    import_map: ImportMap, sources: Mapping[str, LogSource], name: str
) -> dict[str, list[TakenMessage]]:
    """What is taken of each source that is needed. Of two parts of the map that give the same
    field of ours, the first counts that the log has.

    Args:
        name: of the log, for the error.

    Raises:
        LindyError: the log has nothing that the map knows, or two sources that fit one part.
    """
    found: dict[str, list[TakenMessage]] = {}
    given: set[tuple[str, str]] = set()  # key and field that have a source
    for taken in import_map.take:
        if given & {(taken.as_, field) for field in taken.fields}:
            continue
        fitting = [source for source, kind in sources.items() if _fits(taken, source, kind)]
        if len(fitting) > 1:
            raise LindyError(
                f"{name}: {' and '.join(fitting)} are both {taken.type}, and only one can be "
                f'{taken.as_}; write topic = "{fitting[0]}" in its place in a copy of the map'
            )
        for source in fitting:
            found.setdefault(source, []).append(taken)
            given |= {(taken.as_, field) for field in taken.fields}
    if not found:
        if lacking := unfit(import_map, sources, ()):
            raise LindyError(f"{name}: {lacking[0]}; write there the columns that it has")
        if not any(kind.messages for kind in sources.values()):
            raise LindyError(f"{name} holds no whole message")
        named = listed([f"{source} ({kind.kind})" for source, kind in sources.items()])
        takes = listed([*dict.fromkeys(each.topic or each.type for each in import_map.take)])
        raise LindyError(
            f"{name}: nothing in it is in this map, which takes {takes}; it has {named}; "
            f"write a map that says which of these is which sensor"
        )
    return found


def missing(taken: Mapping[str, Sequence[TakenMessage]]) -> list[str]:
    """Keys of ours that could be imported and that the log does not give."""
    given = {each.as_ for several in taken.values() for each in several}
    return [key for key in TARGETS if key not in given]


def unfit(
    import_map: ImportMap, sources: Mapping[str, LogSource], given: Sequence[str]
) -> list[str]:
    """Parts of the map that mean a source of the log which lacks their columns, in words.

    Args:
        given: keys of ours that have a source.
    """
    return [
        f"{source} has no {listed(sorted(lacking))}, which the map names at {taken.where}; "
        f"it has {listed(sorted(kind.columns))}"
        for taken in import_map.take
        for source, kind in sources.items()
        if taken.as_ not in given
        and _is_meant(taken, source, kind)
        and (lacking := _lacks(taken, kind))
    ]


def untaken(
    taken: Mapping[str, Sequence[TakenMessage]], sources: Mapping[str, LogSource]
) -> list[str]:
    """Sources that have messages and are not taken, with their types, and columns that are not of
    those that are. First those that are called as a missing key."""
    found: list[str] = []
    for source, kind in sources.items():
        if source in taken and kind.columns:
            named = set[str]().union(*(each.names for each in taken[source]))
            found += [f"{name} in {source}" for name in sorted(kind.columns - named)]
        elif source not in taken and kind.messages:
            found.append(source if kind.kind == source else f"{source} ({kind.kind})")
    words = {key.rpartition("/")[2] for key in missing(taken)}
    return sorted(found, key=lambda name: not any(word in name.lower() for word in words))


def listed(names: Sequence[str], shown: int = SHOWN) -> str:
    """Those that a sentence has room for."""
    more = f" and {len(names) - shown} more" if len(names) > shown else ""
    return ", ".join(names[:shown]) + more


def _fits(taken: TakenMessage, source: str, kind: LogSource) -> bool:
    return bool(kind.messages) and _is_meant(taken, source, kind) and not _lacks(taken, kind)


def _is_meant(taken: TakenMessage, source: str, kind: LogSource) -> bool:
    if taken.topic:
        pattern = taken.topic.strip("/").replace("[", "[[]")
        return fnmatchcase(source.strip("/"), pattern) and taken.type in ("", kind.kind)
    return kind.kind == taken.type


def _lacks(taken: TakenMessage, kind: LogSource) -> set[str]:
    """Columns without which it is not this message; empty: it has them, or a log without columns
    shows it only by its rows."""
    if not kind.columns:
        return set()
    known = TARGETS[taken.as_]
    fields = [{*field.from_} for name, field in taken.fields.items() if known[name].required]
    if not fields and not any(kind.columns.issuperset(f.from_) for f in taken.fields.values()):
        fields = [{*field.from_} for field in taken.fields.values()]
    return {*taken.only}.union(*fields) - kind.columns
