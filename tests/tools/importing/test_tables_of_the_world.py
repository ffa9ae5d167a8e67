"""A table gives the same samples however a logger, a spreadsheet or a power cut wrote it."""

import codecs
from collections.abc import Callable
from pathlib import Path

import pytest

from messages.sensors import PressureSample
from tests.tools.test_cli_verbs import complaint

from .logs import BEGAN_NS, S, imported, messages, odd, of, pressure_map, report

ROWS = 60


def pascal(k: int) -> float:
    return 101_325.0 + 123.5 * k


def second(k: int) -> float:
    return BEGAN_NS / S + k / 10


NAMES = "time,pressure,temp"
LINES = [f"{second(k):.2f},{pascal(k):.1f},2{k % 10}.5" for k in range(ROWS)]
PLAIN = "\n".join([NAMES, *LINES]) + "\n"
HALF = len(NAMES) + 1 + sum(len(line) + 1 for line in LINES[: ROWS // 2])  # where a row begins


def decimal_comma(text: str) -> str:
    """As Excel writes it in most of Europe."""
    return text.replace(",", ";").replace(".", ",")


def semicolons(text: str) -> str:
    return text.replace(",", ";")


def utf16(text: str, *, big: bool = False, mark: bool = True) -> bytes:
    order = codecs.BOM_UTF16_BE if big else codecs.BOM_UTF16_LE
    return (order if mark else b"") + text.encode("utf-16-be" if big else "utf-16-le")


WHOLE: dict[str, str | bytes] = {
    "plain": PLAIN,
    "comment": "# logger v1.2, pool\n" + PLAIN,
    "comments in between": PLAIN[:HALF] + "# battery, changed, here\n" + PLAIN[HALF:],
    "names in a comment": "# pool\n# " + PLAIN,
    "names and units in comments": f"#{NAMES}\n#s,Pa,°C\n" + PLAIN[len(NAMES) + 1 :],
    "lines of words first": "Instrument 7\nserial: 12\n\n" + PLAIN,
    "windows-1252": PLAIN.replace("temp", "temp °C – “wet”").encode("cp1252"),
    "utf-8": PLAIN.replace("temp", "temp °C – “wet”"),
    "utf-8 with a mark": codecs.BOM_UTF8 + PLAIN.encode(),
    "utf-8 with a broken letter": PLAIN.replace("temp", "°C").encode() .replace(b"20.5", b"\xc3.5"),
    "utf-16": utf16(PLAIN),
    "utf-16, tabs and commas": utf16(PLAIN.replace(",", "\t").replace(".", ",")),
    "utf-16, big end first": utf16(PLAIN, big=True),
    "utf-16 without a mark": utf16(PLAIN, mark=False),
    "semicolon and decimal comma": decimal_comma(PLAIN),
    "semicolon and point": PLAIN.replace(",", ";"),
    "tabs": PLAIN.replace(",", "\t"),
    "bars": PLAIN.replace(",", " | "),
    "blanks": PLAIN.replace(",", "  "),
    "blank after each comma": PLAIN.replace(",", ", "),
    "carriage returns": PLAIN.replace("\n", "\r\n"),
    "a comma at each end": PLAIN.replace("\n", ",\n"),
    "blank lines": PLAIN.replace("\n", "\n\n"),
    "lines of commas": PLAIN[:HALF] + ",,\n" * 3 + PLAIN[HALF:],
    "quotes": '"' + PLAIN.replace(",", '","').replace("\n", '"\n"')[:-1],
    "line breaks in cells": PLAIN.replace("temp", '"temp\n(outside)"').replace("25.5", '"25\n5"'),
    "no line's end": PLAIN[:-1],
    "plus signs": PLAIN.replace(",1", ",+1"),
    "separators of ASCII": PLAIN.replace(",", "\x1f"),
    "exponents": "\n".join([NAMES, *(f"{second(k):.12E},{pascal(k):.6E},20" for k in range(ROWS))]),
    "the end of a text as DOS marks it": PLAIN + "\x1a",
    "a last comment": PLAIN + "# closed, 60 rows\n",
}  # fmt: skip


def found(
    folder: Path, content: str | bytes, unit: str = "Pa", name: str = "a.csv"
) -> tuple[list[int], list[float]]:
    """[ns] When and [Pa] what."""
    log = folder / name
    log.write_bytes(content if isinstance(content, bytes) else content.encode())
    out = imported(log, folder / "dive", *pressure_map(folder, unit))
    values = [one.pressure for one in of(out, "sensor/pressure", PressureSample)]
    return [one.publish_ns for one in messages(out, "sensor/pressure")], values


@pytest.mark.parametrize("kind", WHOLE)
def test_a_whole_table_gives_every_sample(tmp_path: Path, kind: str) -> None:
    times, values = found(tmp_path, WHOLE[kind])
    assert values == pytest.approx([pascal(k) for k in range(ROWS)])
    assert times == pytest.approx([BEGAN_NS + k * S // 10 for k in range(ROWS)], abs=1000)
    assert report(tmp_path / "dive")["remarks"] == []
    assert odd(tmp_path / "dive") == {}


@pytest.mark.parametrize("name", ["a.txt", "a.TSV"])
def test_the_unicode_text_of_a_spreadsheet_is_a_table(tmp_path: Path, name: str) -> None:
    _, values = found(tmp_path, WHOLE["utf-16, tabs and commas"], name=name)
    assert len(values) == ROWS


WRONG: dict[str, tuple[str | bytes, set[int], str]] = {  # content, rows that are lost, what is said
    "cut in a cell that is not the last": (
        PLAIN[: -len("1013.5,29.5\n")], {ROWS - 1},
        "its last row, line 61, was cut off and is left out",
    ),
    "cut in the last cell": (
        PLAIN[:-2], {ROWS - 1}, "its last row, line 61, was cut off and is left out"
    ),
    "cut in the time": (
        PLAIN[: -len(LINES[-1]) + 5], {ROWS - 1}, "its last row, line 61, was cut off"
    ),
    "zeros behind a torn row": (
        PLAIN[:-8].encode() + bytes(9000), {ROWS - 1}, "its last row, line 61, was cut off"
    ),
    "a hole of zeros": (
        PLAIN[: HALF - 6].encode() + bytes(500) + PLAIN[HALF + 4 :].encode(),
        {ROWS // 2 - 1, ROWS // 2}, "1 line is damaged and left out, the first is line 31",
    ),
    "names again": (
        PLAIN[:HALF] + PLAIN.splitlines(keepends=True)[0] + PLAIN[HALF:], set(),
        "1 line is damaged and left out, the first is line 32",
    ),
    "two-byte letters, cut in one": (
        utf16(PLAIN)[:-7], {ROWS - 1}, "its last row, line 61, was cut off"
    ),
    "a line of words at the end": (PLAIN + "End of file\n", set(), "1 line is damaged"),
    "a mean at the end": (
        PLAIN + "mean,101325.0,20.5\n", set(), "1 row of a.csv has no time and is left out"
    ),
    "a word of a C program for no number": (
        PLAIN.replace(LINES[20], f"{second(20):.2f},1.#QNAN,20.5"), {20},
        "pressure is '1.#QNAN' in line 22, which is no number; 1 of its 60 cells is none",
    ),
    "units below the names": (
        NAMES + "\n[s],[Pa],[°C]\n" + PLAIN[len(NAMES) + 1 :], set(),
        "line 2 is no row: [s], [Pa], [°C]",
    ),
    "a row with other cells": (
        PLAIN[:HALF] + "1,2,3,4\n" + PLAIN[HALF:], set(),
        "1 line is damaged and left out, the first is line 32"
    ),
    "a word among the numbers": (
        PLAIN.replace(LINES[20], f"{second(20):.2f},ERR,20.5"), {20},
        "pressure is 'ERR' in line 22, which is no number; 1 of its 60 cells is none",
    ),
    "a word among the times": (
        PLAIN.replace(LINES[20], "restart,1,2"), {20},
        "time is 'restart' in line 22, which is no number",
    ),
}  # fmt: skip


@pytest.mark.parametrize("kind", WRONG)
def test_what_is_lost_of_a_table_is_said_and_nothing_else_is_lost(
    tmp_path: Path, kind: str
) -> None:
    content, lost, said = WRONG[kind]
    _, values = found(tmp_path, content)
    assert values == pytest.approx([pascal(k) for k in range(ROWS) if k not in lost])
    assert said in " ".join(report(tmp_path / "dive")["remarks"])


@pytest.mark.parametrize(
    ("content", "said"),
    [
        (PLAIN.partition("\n")[2], "has no names of columns above its rows"),
        (
            PLAIN[:HALF] + PLAIN[HALF:].replace(LINES[40], "time,temp,pressure"),
            "a.csv: from line 42 on it has other names of columns",
        ),
        (PLAIN.replace("\n1700", "\n17000000"), "which is no time since 1970 in s"),
        (PLAIN.replace("\n1700", "\n1700000"), 'write stamp_unit = "ms" at'),
        (PLAIN.replace("\n1700", "\n12:00:"), "which is neither a number nor a date and time"),
        (PLAIN.replace("\n1700", "\n30.11.2026 "), "which is neither a number nor a date and time"),
    ],
)
def test_a_table_that_means_nothing_is_one_sentence(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], content: str, said: str
) -> None:
    (tmp_path / "a.csv").write_text(content)
    options = (*pressure_map(tmp_path), "--out", str(tmp_path / "dive"))
    assert said in complaint(capsys, "import", str(tmp_path / "a.csv"), *options)
    assert not (tmp_path / "dive").exists()


@pytest.mark.parametrize("decimals", [1, 3])
@pytest.mark.parametrize("write", [str, decimal_comma, semicolons])
def test_three_decimals_are_no_thousands(
    tmp_path: Path, write: Callable[[str], str], decimals: int
) -> None:
    """101,325 of kPa may be either; the other numbers of the table tell."""
    rows = [f"{second(k):.2f},{pascal(k) / 1000:.{decimals}f}" for k in range(ROWS)]
    _, values = found(tmp_path, write("\n".join(["time,pressure", *rows]) + "\n"), "kPa")
    assert values == pytest.approx([pascal(k) for k in range(ROWS)], abs=100.0)


@pytest.mark.parametrize(
    ("cells", "wanted"),
    [
        (["true", "false", ""], "true"),
        (["True", "False", ""], "true"),
        (["1", "2", ""], "1"),
        (["1", "2", ""], '"1"'),
        (["A", "7", ""], '"A"'),
        (["7", "A", "B"], "7"),
    ],
)
def test_a_condition_takes_a_cell_that_means_it(
    tmp_path: Path, cells: list[str], wanted: str
) -> None:
    """However its column is read: one of three rows is meant."""
    log = tmp_path / "a.csv"
    rows = [f"{second(k)},{cells[k % 3]},{pascal(k)}" for k in range(30)]
    log.write_text("\n".join(["time,kind,pressure", *rows]) + "\n")
    options = pressure_map(tmp_path, only=f"only = {{ kind = {wanted} }}")
    assert len(messages(imported(log, tmp_path / "dive", *options), "sensor/pressure")) == 10


def test_a_row_that_has_nothing_in_a_column_of_a_condition_is_left_out(tmp_path: Path) -> None:
    """Also where it is the first one."""
    log = tmp_path / "a.csv"
    kinds = ["", "XX", "BI", "", "BI"]
    rows = [f"{second(k)},{kind},{pascal(k)}" for k, kind in enumerate(kinds)]
    log.write_text("\n".join(["time,kind,pressure", *rows]) + "\n")
    options = pressure_map(tmp_path, only='only = { kind = "BI" }')
    assert len(messages(imported(log, tmp_path / "dive", *options), "sensor/pressure")) == 2
