"""The pictures of the front page: `python -m tests.support.docs.readme_pictures`."""

import shutil
import subprocess
import sys
import tempfile
from pathlib import Path

from tests.support.docs import camera_picture
from tests.support.docs.viewer_picture import picture

DRAWN = {"dive": "dive", "andren-5.6": "retargeting", "link-profiles": "link-profiles"}


def lindy(*said: str) -> None:
    subprocess.run([str(Path(sys.executable).with_name("lindy")), *said], check=True)


def main() -> None:
    with tempfile.TemporaryDirectory() as folder:
        lindy("simulate", "--out", f"{folder}/dive")
        dive = Path(folder)
        (dive / "dive.png").write_bytes(picture(dive / "dive/dive.rrd", at_s=60.0))
        lindy("figures", "--only", "andren-5.6", "link-profiles", "--out", folder)
        for name, page in DRAWN.items():
            shutil.copy(f"{folder}/{name}.png", f"docs/{page}.png")
    camera_picture.main()


if __name__ == "__main__":
    main()
