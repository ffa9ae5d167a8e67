"""Lindy on arm64, emulated: `python -m tests.long.arm64`. Half an hour at most, most of it
downloads and emulation.

A Debian tree for arm64 (debootstrap, whose packages are unpacked and not configured), the core's
wheels for arm64, and qemu-user, which runs them: one dive on virtual time, whose `log_hash` is
compared with that of this computer with the same Python and the same libraries, and a short dive of
real processes.
"""

import json
import os
import shutil
import subprocess
import sys
from pathlib import Path

ROOT = Path(__file__).parents[2]
WORK = ROOT / ".arm64"
TREE, SITE, HERE = WORK / "tree", WORK / "site", WORK / "site-here"
QEMU, MIRROR, RELEASE = "qemu-aarch64-static", "http://deb.debian.org/debian", "bookworm"
PLATFORM, PYTHON = "aarch64-manylinux_2_28", "3.11"  # of that release
NEEDED = (QEMU, "debootstrap", "dpkg-deb", "tar", f"/usr/bin/python{PYTHON}")
QUICK = ("--set", "estimation.calibration.still_time=1")
# A program that starts another one starts it emulated, too.
EMULATED = WORK / "python"
STARTER = f"""#!/bin/sh
exec env -i HOME={WORK} PATH=/usr/bin:/bin LINDY_PYTHON={EMULATED} PYTHONHOME={TREE}/usr \\
    PYTHONPATH={WORK}/hook:{SITE}:{ROOT} {QEMU} -L {TREE} {TREE}/usr/bin/python{PYTHON} "$@"
"""
NATIVE = ("env", f"PYTHONPATH={HERE}:{ROOT}", NEEDED[-1])
HOOK = 'import os, sys\nsys.executable = os.environ["LINDY_PYTHON"]\n'


def main() -> int:
    if sys.platform != "linux" or (missing := [n for n in NEEDED if shutil.which(n) is None]):
        what = ", ".join(missing) if sys.platform == "linux" else "Linux"
        print(f"not run on arm64: {what} is missing (Debian: qemu-user-static, debootstrap)")
        return 0
    if not prepared():
        print("not run on arm64: Debian's packages or the wheels cannot be had here")
        return 0
    hashes = {"arm64": simulated("arm64", str(EMULATED)), "here": simulated("here", *NATIVE)}
    same = len({*hashes.values()}) == 1
    print(f"log_hash of 60 s: {'the same' if same else 'NOT the same'}, {hashes}")
    flown = dive()
    print(f"a dive of real processes: {flown}")
    return 0 if same and flown == "clean" else 1


def prepared() -> bool:
    """Everything is there, from an earlier time or now."""
    WORK.mkdir(exist_ok=True)
    (WORK / "hook").mkdir(exist_ok=True)
    (WORK / "hook" / "sitecustomize.py").write_text(HOOK, encoding="utf-8")
    EMULATED.write_text(STARTER, encoding="utf-8")
    EMULATED.chmod(0o755)
    try:
        if not (TREE / "usr" / "bin" / f"python{PYTHON}").exists():
            unpack()
        for site, platform in ((SITE, ("--python-platform", PLATFORM)), (HERE, ())):
            if not site.exists():
                install(site, platform)
    except subprocess.CalledProcessError as error:
        print(error)
        return False
    return True


def unpack() -> None:
    shutil.rmtree(TREE, ignore_errors=True)
    command = ["debootstrap", "--arch=arm64", "--foreign", "--variant=minbase"]
    subprocess.run(
        [*command, "--include=python3", RELEASE, str(TREE), MIRROR],
        check=True, stdout=subprocess.DEVNULL,
    )  # fmt: skip
    for package in sorted((TREE / "var/cache/apt/archives").glob("*.deb")):
        with subprocess.Popen(
            ["dpkg-deb", "--fsys-tarfile", package], stdout=subprocess.PIPE
        ) as unpacked:
            keep = ["--keep-directory-symlink", "--no-same-owner"]
            command = ["tar", "-x", "-C", str(TREE), *keep]
            subprocess.run(command, check=True, stdin=unpacked.stdout)


def install(site: Path, platform: tuple[str, ...]) -> None:
    uv = [sys.executable, "-m", "uv"]
    locked = ["export", "--quiet", "--frozen", "--no-dev", "--no-emit-project", "--no-hashes"]
    wanted = subprocess.run([*uv, *locked], cwd=ROOT, check=True, capture_output=True).stdout
    command = [*uv, "pip", "install", "--quiet", "--target", str(site), *platform]
    command += ["--python-version", PYTHON, "--python", NEEDED[-1], "--only-binary", ":all:"]
    subprocess.run([*command, "-r", "-"], input=wanted, check=True)


def simulated(name: str, *python: str) -> str:
    """The log_hash of a dive."""
    return report(name, [*python, "-P", "-m", "lindy", "simulate", "--seconds", "60"])["log_hash"]


def dive() -> str:
    """How a dive of real processes ended."""
    words = ["-P", "-m", "lindy", "dive", "--headless", "--grouped", "--seconds", "10", *QUICK]
    return report("dive", [str(EMULATED), *words])["exit"]


def report(name: str, command: list[str]) -> dict[str, str]:
    out = WORK / f"{name}-{os.getpid()}"
    with (WORK / f"{name}.log").open("w", encoding="utf-8") as said:
        subprocess.run([*command, "--out", str(out)], cwd=WORK, check=False, stdout=said)
    return json.loads((out / "report.json").read_text(encoding="utf-8"))


if __name__ == "__main__":
    sys.exit(main())
