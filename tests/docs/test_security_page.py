"""Each row of the table of attacks names a test that there is, or is a limit the page names."""

import re
from pathlib import Path

ROOT = Path(__file__).parents[2]
PAGE = (ROOT / "docs/security.md").read_text(encoding="utf-8")
ROW = re.compile(r"^\| (?P<what>[^|]+) \| (?P<seen>[^|]+) \| (?P<proof>[^|]+) \|$", re.MULTILINE)
TEST = re.compile(r"`(test_\w+)`")


def rows() -> list[re.Match[str]]:
    table = PAGE.partition("## Attacks")[2].partition("\n## ")[0]
    return [row for row in ROW.finditer(table) if row["what"] not in ("attack", "---")]


def test_every_attack_has_a_test_or_is_a_named_limit() -> None:
    files = list((ROOT / "tests").rglob("test_*.py"))
    code = "\n".join(path.read_text(encoding="utf-8") for path in files)
    there = {*re.findall(r"def (test_\w+)\(", code)}
    found = rows()
    assert len(found) >= 25
    for row in found:
        named = TEST.findall(row["proof"])
        assert named or row["proof"].startswith("limit"), row[0]
        assert {*named} <= there, {*named} - there
