"""The pictures of the front page: `python -m tests.support.docs.readme_pictures`."""

import shutil
import subprocess
import sys
import tempfile
from pathlib import Path

from tests.support.docs import camera_picture

DRAWN = {"dive": "dive", "andren-5.6": "retargeting", "link-profiles": "link-profiles"}


def lindy(*said: str) -> None:
    subprocess.run([str(Path(sys.executable).with_name("lindy")), *said], check=True)


def main() -> None:
    with tempfile.TemporaryDirectory() as folder:
        lindy("simulate", "--out", f"{folder}/dive")
        lindy("picture", f"{folder}/dive/dive.rrd", "--at", "60", "--out", f"{folder}/dive.png")
        lindy("figures", "--only", "andren-5.6", "link-profiles", "--out", folder)
        for name, page in DRAWN.items():
            shutil.copy(f"{folder}/{name}.png", f"docs/{page}.png")
    camera_picture.main()


if __name__ == "__main__":
    main()
