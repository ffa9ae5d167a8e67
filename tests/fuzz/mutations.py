"""Damaged copies of real inputs: bits, bytes, pieces, splices, numbers at their extremes, words."""

import re
from collections.abc import Sequence

from hypothesis import strategies as st

NUMBER = re.compile(rb"[-+]?\d+(?:\.\d*)?(?:[eE][-+]?\d+)?")
WORD = re.compile(rb"\"[^\"\n]{0,200}\"|[A-Za-z_][\w.\-]*")
# What readers of text, of JSON and of binary numbers have tripped over before.
NUMBERS = (
    b"0", b"-0.0", b"-1", b"1e999", b"-1e999", b"nan", b"inf", b"NaN", b"1e-320", b"1e308", b"255",
    b"65536", b"4294967296", b"9007199254740993", b"9223372036854775807", b"18446744073709551616",
    b"9" * 400, b"9" * 5000, b"null", b"true", b'""', b"[]", b"{}", b"1_0", b"0x7f", "²".encode(),
)  # fmt: skip
WORDS = (
    b'""', b'"\\u0000"', b'"\x1b[2J\x07"', b'"\\ud800"', b'"../../etc/passwd"', b'"/dev/zero"',
    b'"' + b"a" * 5000 + b'"', b"'", b'"""', b"[" * 400, b"{" * 400, b"a." * 300 + b"a",
    b"[[", b"]]", b"\xff\xfe", b"\r", b"\n", b"=", b",", b"#", b"%s%n", '"﷐é\u202e"'.encode(),
    b"-", b".",
)  # fmt: skip
EXTREMES = tuple(
    n.to_bytes(size, order)
    for size in (1, 2, 4, 8)
    for n in (0, 1, 2 ** (8 * size - 1) - 1, 2 ** (8 * size - 1), 2 ** (8 * size) - 1)
    for order in ("little", "big")
)
MOST = 300_000  # [bytes] what grows is cut there


@st.composite
def mutated(draw: st.DrawFn, corpus: Sequence[bytes]) -> bytes:
    """One of the inputs with one to six changes."""
    data = draw(st.sampled_from(corpus))
    for _ in range(draw(st.integers(1, 6))):
        change = draw(st.sampled_from(CHANGES))
        data = change(draw, data, corpus)[:MOST]
    return data


def _place(draw: st.DrawFn, data: bytes) -> int:
    return draw(st.integers(0, max(0, len(data) - 1)))


def _span(draw: st.DrawFn, data: bytes) -> tuple[int, int]:
    at = _place(draw, data)
    length = draw(st.integers(0, 8) | st.integers(0, max(0, len(data) - at)))
    return at, at + length


def _flipped(draw: st.DrawFn, data: bytes, _: Sequence[bytes]) -> bytes:
    if not data:
        return data
    at = _place(draw, data)
    return data[:at] + bytes([data[at] ^ (1 << draw(st.integers(0, 7)))]) + data[at + 1 :]


def _overwritten(draw: st.DrawFn, data: bytes, _: Sequence[bytes]) -> bytes:
    at, new = _place(draw, data), draw(st.sampled_from(EXTREMES) | st.binary(max_size=8))
    return data[:at] + new + data[at + len(new) :]


def _inserted(draw: st.DrawFn, data: bytes, _: Sequence[bytes]) -> bytes:
    at = _place(draw, data)
    new = draw(st.sampled_from((*EXTREMES, *NUMBERS, *WORDS)) | st.binary(max_size=8))
    return data[:at] + new + data[at:]


def _cut_off(draw: st.DrawFn, data: bytes, _: Sequence[bytes]) -> bytes:
    return data[: _place(draw, data)]


def _taken_out(draw: st.DrawFn, data: bytes, _: Sequence[bytes]) -> bytes:
    begin, end = _span(draw, data)
    return data[:begin] + data[end:]


def _repeated(draw: st.DrawFn, data: bytes, _: Sequence[bytes]) -> bytes:
    begin, end = _span(draw, data)
    return data[:begin] + data[begin:end] * draw(st.integers(2, 40)) + data[end:]


def _spliced(draw: st.DrawFn, data: bytes, corpus: Sequence[bytes]) -> bytes:
    other = draw(st.sampled_from(corpus))
    begin, end = _span(draw, other)
    at, behind = _span(draw, data)
    return data[:at] + other[begin:end] + data[behind:]


def _renumbered(draw: st.DrawFn, data: bytes, _: Sequence[bytes]) -> bytes:
    return _replaced(draw, data, NUMBER, st.sampled_from(NUMBERS))


def _reworded(draw: st.DrawFn, data: bytes, _: Sequence[bytes]) -> bytes:
    words = [found.group() for found in WORD.finditer(data)]
    return _replaced(draw, data, WORD, st.sampled_from((*WORDS, *NUMBERS, *words)))


def _replaced(
    draw: st.DrawFn, data: bytes, what: re.Pattern[bytes], by: st.SearchStrategy[bytes]
) -> bytes:
    found = [each.span() for each in what.finditer(data)]
    if not found:
        return data
    begin, end = draw(st.sampled_from(found))
    return data[:begin] + draw(by) + data[end:]


CHANGES = (
    _flipped, _overwritten, _inserted, _cut_off, _taken_out, _repeated, _spliced, _renumbered,
    _renumbered, _reworded, _reworded,
)  # fmt: skip
