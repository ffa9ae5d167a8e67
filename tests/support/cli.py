"""The command line, called in this process."""

import pytest

from tools.__main__ import main


def complaint(capsys: pytest.CaptureFixture[str], *arguments: str) -> str:
    """Runs a command that must fail well, and returns what it says."""
    assert main(arguments) == 1
    out, err = capsys.readouterr()
    assert out == ""
    assert err.startswith("lindy: ")
    assert err.count("\n") == 1
    assert "Traceback" not in err
    assert "error in Lindy" not in err
    return err
