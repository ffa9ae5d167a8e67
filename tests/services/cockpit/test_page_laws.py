"""What the page says, sounds, counts and holds, under node; skipped where there is none. And that
its messages have types."""

import os
import shutil
import subprocess
from pathlib import Path

import pytest

pytest.importorskip("websockets", reason="the extra cockpit is not installed")

from services.cockpit.io.files import PageFiles
from tests.support.page_types import protocol

NODE = shutil.which("node")
LAWS = Path(__file__).with_name("page_laws.mjs")


@pytest.mark.skipif(NODE is None, reason="no node on the path")
def test_alarms_words_units_and_hold_buttons_keep_their_laws(tmp_path: Path) -> None:
    assert NODE is not None
    (tmp_path / "package.json").write_text('{"type": "module"}')
    for name, body in PageFiles().contents.items():
        (tmp_path / name).write_bytes(body)
    told = subprocess.run(
        [NODE, "--test", "--test-reporter=spec", LAWS],
        env={**os.environ, "LINDY_PAGE": str(tmp_path)},
        capture_output=True,
        text=True,
    )
    assert told.returncode == 0, told.stdout + told.stderr


def test_every_message_of_the_page_has_a_type() -> None:
    text = protocol()
    for line in ('  kind: "wish";', "  held_ms: number;", "  depth_m?: number | null;"):
        assert line in text
    assert "lost?: string;" in text[text.index("interface Personal") :]
