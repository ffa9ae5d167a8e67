"""The wiring, in the virtual host, with a test that plays the pilot and the vehicle."""

import re
from pathlib import Path

import pytest

from services.runtime.config.errors import LindyError
from services.runtime.config.stack import Stack
from services.runtime.hosts.stack_file import ServiceSpec
from services.runtime.hosts.virtual_host import VirtualHost

ROW = ServiceSpec(sides=["drone"])


@pytest.mark.parametrize(
    ("wrong", "sentence"),
    [
        (r'name = "vertical"(.*?)direction = \[0.0, 0.0, 1.0\]', "cannot drive heave"),
        (r'name = "lateral"(.*?)direction = \[0.0, 1.0, 0.0\]', "direction must not be"),
    ],
)
def test_a_vehicle_that_cannot_be_flown_is_refused_by_the_name_of_its_file(
    tmp_path: Path, wrong: str, sentence: str
) -> None:
    sound = Stack().vehicle_path.read_text()
    name = wrong.split('"')[1]
    becomes = "[0.0, 1.0, 0.0]" if name == "vertical" else "[0.0, 0.0, 0.0]"
    replacement = rf'name = "{name}"\1direction = {becomes}'
    broken = tmp_path / "broken.toml"
    broken.write_text(re.sub(wrong, replacement, sound, count=1, flags=re.DOTALL))
    stack = Stack(vehicle=str(broken))
    with pytest.raises(LindyError, match=rf"broken\.toml(:\d+)?: .*{sentence}"):
        VirtualHost().add("control", ROW, stack)
