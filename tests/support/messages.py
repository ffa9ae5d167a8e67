"""A message of any kind without naming each of its fields: benign, or drawn."""

from typing import Any, TypeVar

import msgspec
from hypothesis import strategies as st
from msgspec import inspect

from messages.message import Message
from messages.topic import Topic
from messages.units import STAMP
from services.runtime.bus.envelope import Envelope

M = TypeVar("M", bound=Message)
FACING_NORTH = (1.0, 0.0, 0.0, 0.0)


def example(kind: type[M], now: int = 0, *, full: bool = False, **fields: Any) -> M:
    """Of these fields and, in those that must be given, of `now` [ns], ones, level and facing
    north, the first of the allowed words. `full`: also in those that may be left out."""
    info = inspect.type_info(kind)
    assert isinstance(info, inspect.StructType)
    made = {
        field.name: _plain(field.type, field.name, now, full)
        for field in info.fields
        if (field.required or full) and field.name not in fields
    }
    given = {name: value for name, value in fields.items() if value is not msgspec.UNSET}
    return msgspec.convert(made | given, kind, str_keys=True)


def enveloped(topic: Topic[M], message: M, key: str = "") -> Envelope:
    """As it travels. `key`: of a family's member."""
    return Envelope(key or topic.key, msgspec.msgpack.encode(message), topic.encoding)


def _plain(kind: inspect.Type, name: str, now: int, full: bool) -> Any:
    match kind:
        case inspect.Metadata():
            return now if kind.extra == STAMP else _plain(kind.type, name, now, full)
        case inspect.IntType() | inspect.FloatType():
            one = float if isinstance(kind, inspect.FloatType) else int
            return one(min(1, 1 if kind.le is None else kind.le))
        case inspect.BoolType():
            return False
        case inspect.LiteralType():
            return kind.values[0]
        case inspect.UnionType():
            inner = [each for each in kind.types if not isinstance(each, inspect.NoneType)]
            return _plain(inner[0], name, now, full) if full else None
        case inspect.TupleType():
            if name == "attitude":
                return FACING_NORTH
            return tuple(_plain(each, "", now, full) for each in kind.item_types)
        case inspect.VarTupleType():
            return [_plain(kind.item_type, "", now, full)] * (kind.min_length or 0)
        case inspect.StructType():
            return {
                field.name: _plain(field.type, field.name, now, full)
                for field in kind.fields
                if field.required or full
            }
        case _:
            empty: dict[type[inspect.Type], Any] = {
                inspect.StrType: name, inspect.BytesType: b"x", inspect.DictType: {},
            }  # fmt: skip
            return empty.get(type(kind), ())


def values(kind: inspect.Type) -> st.SearchStrategy[Any]:  # noqa: C901 - one case for each type
    """Any value of a field, within its limits, as plain data; the ends of its range often among
    them."""
    match kind:
        case inspect.Metadata():
            return values(kind.type)
        case inspect.FloatType():
            assert not {kind.ge, kind.le} & {None}, "without limits, which refuse what is no number"
            return st.floats(kind.ge, kind.le)
        case inspect.IntType(ge=int(least), le=int(most)):
            return st.sampled_from([least, most, max(least, 0)]) | st.integers(least, most)
        case inspect.StrType(max_length=int(most)):
            return st.text(max_size=min(most, 200))
        case inspect.BytesType(max_length=int(most)):
            return st.binary(max_size=min(most, 200))
        case inspect.BoolType():
            return st.booleans()
        case inspect.NoneType():
            return st.none()
        case inspect.LiteralType():
            return st.sampled_from(kind.values)
        case inspect.UnionType():
            return st.one_of([values(each) for each in kind.types])
        case inspect.TupleType():
            return st.tuples(*map(values, kind.item_types)).map(list)
        case inspect.VarTupleType(max_length=int(most)) | inspect.ListType(max_length=int(most)):
            least = kind.min_length or 0
            return st.lists(values(kind.item_type), min_size=least, max_size=min(most, 12))
        case inspect.DictType(max_length=int()):
            return st.dictionaries(values(kind.key_type), values(kind.value_type), max_size=8)
        case inspect.StructType():
            return st.fixed_dictionaries(
                {f.encode_name: values(f.type) for f in kind.fields if f.required},
                optional={f.encode_name: values(f.type) for f in kind.fields if not f.required},
            )
        case _:
            raise AssertionError(f"no limits are known for {kind}")


def any_of(kind: type[M]) -> st.SearchStrategy[M]:
    """Any message of a kind."""
    return values(inspect.type_info(kind)).map(lambda said: msgspec.convert(said, kind))
