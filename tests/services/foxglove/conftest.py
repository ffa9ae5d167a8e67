"""Programs that use Foxglove's own packages, for those who have them."""

import json
import os
import shutil
import subprocess
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from tests.support.patience import PATIENCE_S

PROGRAMS = Path(__file__).with_name("programs")


class FoxgloveProgram:
    """A program of `programs/` while it runs."""

    def __init__(self, node: str, modules: str, name: str, *words: str) -> None:
        self.process = subprocess.Popen(
            [node, str(PROGRAMS / name), *words],
            env={**os.environ, "NODE_PATH": modules},
            stdout=subprocess.PIPE,
            stderr=subprocess.PIPE,
            text=True,
        )

    @property
    def runs(self) -> bool:
        return self.process.poll() is None

    def told(self) -> dict[str, Any]:
        """What it printed before it ended well."""
        said, complaint = self.process.communicate(timeout=PATIENCE_S)
        assert self.process.returncode == 0, complaint
        return json.loads(said)


@pytest.fixture
def foxglove_program() -> Callable[..., FoxgloveProgram]:
    """Starts a program with its arguments."""
    node, modules = shutil.which("node"), os.environ.get("LINDY_NODE_MODULES")
    if node is None or modules is None:
        pytest.skip("LINDY_NODE_MODULES does not name a folder with Foxglove's packages (.ci/run)")

    def start(name: str, *words: str) -> FoxgloveProgram:
        return FoxgloveProgram(node, modules, name, *words)

    return start
