"""The seam to the operating system as it is on Windows, as far as Linux can pretend."""

import os
from importlib.util import module_from_spec, spec_from_file_location
from types import ModuleType

import pytest

from services.runtime.os import system


def portable() -> ModuleType:
    """Another copy of `system`, of a computer without POSIX."""
    spec = spec_from_file_location("portable", system.__file__)
    assert spec is not None
    assert spec.loader is not None
    found = module_from_spec(spec)
    with pytest.MonkeyPatch.context() as without:
        without.delattr(os, "fork")
        spec.loader.exec_module(found)
    return found
