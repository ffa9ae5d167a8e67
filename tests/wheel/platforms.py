"""The table of wheels: what Lindy with the extra `all` brings to each platform, as uv finds it in
the package index, from wheels alone; the core is bold. `python -m tests.wheel.platforms`."""

import subprocess
import sys
from pathlib import Path

ROOT = Path(__file__).parents[2]
PLATFORMS = {
    "Linux x86-64": "x86_64-manylinux_2_28",
    "Linux arm64": "aarch64-manylinux_2_28",
    "Windows": "x86_64-pc-windows-msvc",
    "macOS arm64": "aarch64-apple-darwin",
    "macOS Intel": "x86_64-apple-darwin",
}
PYTHONS = ("3.11", "3.12", "3.13", "3.14")
Versions = dict[str, str]  # by package


def resolved(platform: str, python: str, *extras: str) -> Versions | None:
    """None: a package has no wheel there."""
    command = [sys.executable, "-m", "uv", "pip", "compile", "--quiet", "--no-header"]
    command += ["--no-annotate", "--only-binary", ":all:", "--python-platform", platform]
    command += ["--python-version", python, *extras, "pyproject.toml"]
    done = subprocess.run(command, cwd=ROOT, capture_output=True, text=True, check=False)
    if done.returncode != 0:
        print(f"{platform}, Python {python}: {done.stderr.strip()}", file=sys.stderr)
        return None
    return dict(line.partition(";")[0].strip().split("==") for line in done.stdout.splitlines())


def table() -> str:
    core, everything = set[str](), dict[str, dict[str, Versions]]()
    for name, platform in PLATFORMS.items():
        everything[name] = {}
        for python in PYTHONS:
            core |= set(resolved(platform, python) or ())
            found = resolved(platform, python, "--all-extras")
            if found is not None:
                everything[name][python] = found
    packages = sorted({p for each in everything.values() for v in each.values() for p in v})
    lines = ["| package | " + " | ".join(PLATFORMS), "|---" * (1 + len(PLATFORMS))]
    for package in sorted(packages, key=lambda p: (p not in core, p)):
        cells = [cell(each, package) for each in everything.values()]
        lines.append(f"| {f'**{package}**' if package in core else package} | " + " | ".join(cells))
    return "".join(f"{line} |\n" if line[-1] != "-" else f"{line}|\n" for line in lines)


def cell(by_python: dict[str, Versions], package: str) -> str:
    """Its versions, and for which Python each is, where that differs."""
    found: dict[str, list[str]] = {}
    for python, versions in by_python.items():
        if package in versions:
            found.setdefault(versions[package], []).append(python)
    if [*found.values()] == [[*PYTHONS]]:
        return next(iter(found))
    return ", ".join(f"{version} ({spoken(pythons)})" for version, pythons in found.items()) or "–"


def spoken(pythons: list[str]) -> str:
    return pythons[0] if len(pythons) == 1 else f"{pythons[0]}–{pythons[-1].partition('.')[2]}"


if __name__ == "__main__":
    print(table(), end="")
