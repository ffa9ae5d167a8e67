"""What a dive lacks is one sentence before anything is started or written."""

from pathlib import Path

import pytest

from tests.support.cli import complaint


def nothing(_: str) -> None:
    """As if no package were installed."""


@pytest.mark.parametrize(
    ("words", "says"),
    [
        (("--cockpit", "--pilot", "script:first_dive"), "cockpit needs websockets"),
        (("--stack", "camera", "--pilot", "script:first_dive"), "camera needs av"),
        (("--stack", "foxglove", "--pilot", "script:first_dive"), "foxglove needs foxglove"),
        (("--pilot", "keyboard"), "pads and the keyboard need pygame"),
        (("--pilot", "gamepad"), "pads and the keyboard need pygame"),
        (("--stack", "mavlink"), "needs pymavlink, which is missing: in the folder"),
        (
            ("--stack", "ardusub", "--vehicle", "bluerov2_heavy"),
            "needs pymavlink, which is missing",
        ),
    ],
)
def test_without_its_packages_a_dive_is_not_begun(
    words: tuple[str, ...],
    says: str,
    capsys: pytest.CaptureFixture[str],
    monkeypatch: pytest.MonkeyPatch,
    tmp_path: Path,
) -> None:
    monkeypatch.setattr("tools.packages.find_spec", nothing)
    monkeypatch.chdir(tmp_path)
    assert says in complaint(capsys, "dive", "--headless", *words)
    assert list(tmp_path.iterdir()) == []


def test_a_camera_s_dive_is_not_simulated_without_its_package(
    capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    monkeypatch.setattr("tools.packages.find_spec", nothing)
    monkeypatch.chdir(tmp_path)
    assert "camera needs av" in complaint(capsys, "simulate", "--stack", "camera", "--out", "dive")
    assert list(tmp_path.iterdir()) == []


def test_without_a_display_the_keyboard_is_refused(
    capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    for name in ("DISPLAY", "WAYLAND_DISPLAY", "SDL_VIDEODRIVER"):
        monkeypatch.delenv(name, raising=False)
    monkeypatch.setattr("sys.platform", "linux")
    monkeypatch.chdir(tmp_path)
    assert "needs a window" in complaint(capsys, "dive", "--headless", "--pilot", "keyboard")
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize("text", ["foo = 1\n", "[sticks\n", "\xff\x00", None])
def test_a_wrong_pad_profile_is_refused_before_the_dive(
    text: str | None,
    capsys: pytest.CaptureFixture[str],
    monkeypatch: pytest.MonkeyPatch,
    tmp_path: Path,
) -> None:
    monkeypatch.chdir(tmp_path)
    file = tmp_path / "mine.toml"
    if text is not None:
        file.write_bytes(text.encode("latin-1"))
    words = ("dive", "--headless", "--pilot", "gamepad", "--set", f"gamepad.profile={file}")
    assert "mine.toml" in complaint(capsys, *words)
    assert list(tmp_path.iterdir()) == ([] if text is None else [file])
