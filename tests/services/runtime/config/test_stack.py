"""What a dive's choices must be before anything starts."""

import re
import shutil
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from services.runtime.config.errors import LindyError
from services.runtime.config.settings import deploy_file
from services.runtime.config.stack import Stack
from services.runtime.hosts.registry import Registry
from tools.checks import known_tables


@pytest.mark.parametrize("name", ["My ROV!", "rov.v2", "blåhaj", "a*", " "])
def test_a_vehicle_file_whose_name_no_key_may_have_is_refused(tmp_path: Path, name: str) -> None:
    path = tmp_path / f"{name}.toml"
    shutil.copy(deploy_file("vehicles", "pioneer"), path)
    with pytest.raises(LindyError) as refused:
        Stack(vehicle=str(path)).check(known_tables(Registry.read()))
    (sentence,) = str(refused.value).splitlines()
    assert sentence.startswith(f"{path}: ")
    assert "letters a to z, digits, '_' and '-'" in sentence
    assert repr(name) in sentence


def test_capitals_and_hyphens_become_what_keys_are_made_of(tmp_path: Path) -> None:
    path = tmp_path / "BlueROV2-Heavy.toml"
    shutil.copy(deploy_file("vehicles", "bluerov2_heavy"), path)
    stack = Stack(vehicle=str(path))
    stack.check(known_tables(Registry.read()))
    assert stack.vehicle_name == "bluerov2_heavy"


@given(st.text(min_size=1))
def test_a_vehicles_name_is_a_chunk_of_a_key_or_refused(stem: str) -> None:
    stack = Stack()
    vars(stack)["vehicle_path"] = Path(f"{stem.replace('/', '')}.toml")
    try:
        assert re.fullmatch(r"[a-z0-9_]+", stack.vehicle_name)
    except LindyError:
        assert not re.fullmatch(r"[a-z0-9_-]+", stem)
