"""The wheel, installed into an environment of its own, and a folder in which a user works.

The libraries it depends on are those of this environment. In the user's folder are modules called
as the folders of this repository; nothing of Lindy may import them.
"""

import os
import shutil
import subprocess
import sys
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from sysconfig import get_path

import pytest

from tests.support.once import once

ROOT = Path(__file__).parents[2]
USERS = ("services.py", "messages/__init__.py", "tools/__init__.py", "deploy.py", "tests.py")


@dataclass(frozen=True)
class Installed:
    """An environment with nothing of Lindy but the wheel, and the folder of a user."""

    folder: Path
    wheel: Path
    desk: Path  # where the user works

    @property
    def programs(self) -> Path:
        return self.folder / "env" / "bin"

    @property
    def packages(self) -> Path:
        return Path(get_path("purelib", vars={"base": str(self.folder / "env")}))

    @property
    def environment(self) -> dict[str, str]:
        # What a test in this process has set for pygame is not the user's.
        ours = ("PYTHON", "VIRTUAL_ENV", "SDL_", "PYGAME_")
        kept = {k: v for k, v in os.environ.items() if not k.startswith(ours)}
        # Keys, notes and caches of whoever runs the tests stay out of it.
        own = {"HOME": str(self.folder), "PATH": f"{self.programs}:{os.environ['PATH']}"}
        return kept | own

    def run(self, command: str | Sequence[str], patience: float = 300.0) -> tuple[int, str, str]:
        """Exit status, stdout and stderr of a command in the user's folder; of a shell's, if it is
        one string."""
        done = subprocess.run(
            ["bash", "-o", "pipefail", "-c", command] if isinstance(command, str) else command,
            cwd=self.desk, env=self.environment, capture_output=True, text=True,
            timeout=patience, check=False, stdin=subprocess.DEVNULL,
        )  # fmt: skip
        return done.returncode, done.stdout, done.stderr


@pytest.fixture(scope="session")
def installed(tmp_path_factory: pytest.TempPathFactory, worker_id: str) -> Installed:
    folder = once(tmp_path_factory, worker_id, "wheel", install)
    (wheel,) = folder.glob("*.whl")
    return Installed(folder, wheel, folder / "desk")


def install(folder: Path) -> None:
    python = [sys.executable, "-P", "-m"]
    build = [*python, "hatchling", "build", "-t", "wheel", "-d", str(folder)]
    subprocess.run(build, cwd=ROOT, check=True)
    subprocess.run([*python, "venv", "--without-pip", str(folder / "env")], check=True)
    (wheel,) = folder.glob("*.whl")
    subprocess.run(
        [*python, "pip", "--python", str(folder / "env"), "install", "--quiet", "--no-index",
         "--no-deps", "--no-compile", str(wheel)],
        check=True,
    )  # fmt: skip
    libraries = folder / "libraries"
    libraries.mkdir()
    for library in Path(get_path("purelib")).iterdir():
        if "lindy" not in library.name and library.suffix != ".pth":
            (libraries / library.name).symlink_to(library)
    found = Installed(folder, wheel, folder / "desk")
    (found.packages / "libraries.pth").write_text(f"{libraries}\n")
    found.desk.mkdir()
    for name in USERS:
        path = found.desk / name
        path.parent.mkdir(exist_ok=True)
        path.write_text(f"raise ImportError('{name} is the user\\'s own')\n")
    shutil.copytree(ROOT / "examples", found.desk / "examples")
    for own in (found.desk / "examples").glob("*/"):
        shutil.copy(found.desk / "services.py", own)
