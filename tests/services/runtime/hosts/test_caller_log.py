"""Who comes to a hub from another machine is in its log."""

import pytest

from services.runtime.hosts.process_host import CallerLog


def test_a_caller_who_tries_for_hours_does_not_fill_the_log(
    capsys: pytest.CaptureFixture[str],
) -> None:
    callers = CallerLog(["pilot:ann"])
    for _ in range(150):
        callers.see("pilot:eve", True)
    callers.see("pilot:ann", True)
    callers.see("pilot:ann", False)
    said = capsys.readouterr().err.splitlines()
    refused = "it is not admitted, and can neither hear nor say anything"
    assert said == [
        f"warning hub: pilot:eve connected; {refused}",
        f"warning hub: pilot:eve connected (10 times); {refused}",
        f"warning hub: pilot:eve connected (100 times); {refused}",
        "info hub: pilot:ann connected",
        "info hub: pilot:ann left",
    ]
