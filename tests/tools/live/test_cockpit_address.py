"""Where the page is: printed, if it can be there."""

import socket

import pytest

from services.runtime.config.errors import LindyError
from services.runtime.config.stack import Stack
from tools.live.cockpit import announce


def test_no_address_is_printed_of_a_port_that_is_taken(capsys: pytest.CaptureFixture[str]) -> None:
    with socket.create_server(("127.0.0.1", 0)) as taken:
        port = taken.getsockname()[1]
        stack = Stack(vehicle="pioneer", overrides=[f"cockpit.port={port}"])
        with pytest.raises(LindyError, match=rf"cannot listen on 127\.0\.0\.1:{port}"):
            announce(stack, browser=False)
    assert capsys.readouterr().out == ""
    announce(stack, browser=False)
    assert f"http://127.0.0.1:{port}/" in capsys.readouterr().out
