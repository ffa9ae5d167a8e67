"""The wheel with each Python that it is for: `python -m tests.wheel.pythons [WHEEL]`.

Each gets a clean environment with the core alone. One that is not on this computer is named.
"""

import os
import subprocess
import sys
from pathlib import Path
from tempfile import TemporaryDirectory

ROOT = Path(__file__).parents[2]
PYTHONS = ("3.11", "3.12", "3.13", "3.14")
UV = [sys.executable, "-m", "uv"]
QUICK = "--seconds 2 --set estimation.calibration.still_time=1"
FLOWN = ("--version", "dive --help", f"simulate --no-files {QUICK}", f"dive --headless {QUICK}")


def main(wheel: Path | None) -> int:
    with TemporaryDirectory(prefix="lindy-pythons-") as name:
        folder = Path(name)
        if wheel is None:
            build = [*UV, "build", "--quiet", "--wheel", "--out-dir", name]
            subprocess.run(build, cwd=ROOT, check=True)
            (wheel,) = folder.glob("*.whl")
        # As `uvx lindy` does it, in an environment that is thrown away.
        uvx = [*UV, "tool", "run", "--isolated", "--from", str(wheel.resolve()), "lindy"]
        subprocess.run([*uvx, "dive", "--help"], check=True, stdout=subprocess.DEVNULL)
        said = {python: fly(python, wheel.resolve(), folder / python) for python in PYTHONS}
    for python, how in said.items():
        print(f"Python {python}: {how}")
    return 1 if any(how.startswith("FAILED") for how in said.values()) else 0


def fly(python: str, wheel: Path, folder: Path) -> str:
    find = [*UV, "python", "find", "--no-project", "--no-python-downloads", "--system", python]
    pyenv = [str(path) for path in Path.home().glob(f".pyenv/versions/{python}.*/bin")]
    path = os.pathsep.join([*pyenv, os.environ["PATH"]])  # its shims lead to one version only
    found = subprocess.run(
        find, env={**os.environ, "PATH": path}, capture_output=True, text=True, check=False
    )
    if found.returncode != 0:
        return "skipped, it is not on this computer"
    venv = folder / "env"
    for command in (
        ["venv", "--quiet", "--python", found.stdout.strip(), str(venv)],
        ["pip", "install", "--quiet", "--python", str(venv), "--only-binary", ":all:", str(wheel)],
    ):
        done = subprocess.run([*UV, *command], capture_output=True, text=True, check=False)
        if done.returncode != 0:
            return f"FAILED, not installed: {done.stderr}"
    for words in FLOWN:
        command = [str(venv / "bin" / "lindy"), *words.split()]
        done = subprocess.run(command, cwd=folder, capture_output=True, text=True, check=False)
        if done.returncode != 0:
            return f"FAILED, lindy {words}: {done.stdout}{done.stderr}"
    return "installed and flown"


if __name__ == "__main__":
    sys.exit(main(Path(sys.argv[1]) if len(sys.argv) > 1 else None))
