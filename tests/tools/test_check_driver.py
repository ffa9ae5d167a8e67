"""`lindy check-driver` names the broken promise and what it saw. Rules: tools/driver/rules.py."""

from pathlib import Path

import pytest

from tools.__main__ import main

EXAMPLE = Path(__file__).parents[2] / "examples" / "point_vehicle"


def test_a_broken_rule_is_one_line_that_says_what_was_seen(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    wrong = (EXAMPLE / "vehicle.toml").read_text(encoding="utf-8")
    vehicle = tmp_path / "vehicle.toml"
    vehicle.write_text(f"{wrong}\n[estimation.watch]\npressure_rate = 3.0\n", encoding="utf-8")
    assert main(["check-driver", str(EXAMPLE / "stack.toml"), str(vehicle), "--still"]) == 1
    lines = capsys.readouterr().out.splitlines()
    (broken,) = [line for line in lines if line.startswith("broken")]
    assert broken.startswith(
        "broken    Sensors come at their rates. But: sensor/pressure comes at "
    )
    assert broken.endswith(" Hz, expected 3.")
    assert [line.split("  ")[0] for line in lines].count("left out") == 2


def test_a_driver_that_needs_real_time_turns_nothing_unless_it_may(
    capsys: pytest.CaptureFixture[str],
) -> None:
    assert main(["check-driver", "ardusub", "bluerov2_heavy"]) == 1
    assert "take the propellers off" in capsys.readouterr().err
