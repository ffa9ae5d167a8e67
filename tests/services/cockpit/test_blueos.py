"""The cockpit as an extension of BlueOS: how it is found, and that its page works below a path."""

import json
import tomllib
import urllib.error
import urllib.request
from collections.abc import Iterator
from contextlib import ExitStack
from importlib.metadata import version
from itertools import pairwise
from pathlib import Path

import pytest

pytest.importorskip("websockets", reason="the extra cockpit is not installed")

from websockets.exceptions import InvalidStatus
from websockets.sync.client import connect

from messages.events import Outbox
from services.cockpit.core import Settings
from services.cockpit.io.access import access_to
from services.cockpit.io.server import PageServer
from services.cockpit.page_messages import PageOpened
from services.runtime.config.settings import DEPLOY
from services.runtime.hosts.registry import Registry
from tests.support.blueos_double import TAKEN, asked_for, labels, proxy, registered
from tests.support.doors import free_port
from tests.support.patience import PATIENCE_S, until

FILE = DEPLOY / "blueos" / "Dockerfile"
SAID = labels(FILE)


class Extension:
    """The cockpit as the extension has it, behind the proxy of BlueOS."""

    def __init__(self, exits: ExitStack) -> None:
        port = free_port()
        self.settings = Settings(host="0.0.0.0", port=port, insecure=True)
        self.server = PageServer(self.settings, access_to(self.settings), Outbox())
        self.server.start(lambda: None)
        exits.callback(self.server.close)
        self.metadata = registered(port)
        self.outside = exits.enter_context(proxy(self.metadata["sanitized_name"], port))
        self.path = f"127.0.0.1:{self.outside}/extensionv2/lindy/"

    def get(self, path: str) -> str:
        with urllib.request.urlopen(f"http://{self.path}{path}", timeout=PATIENCE_S) as answer:
            return answer.read().decode()


@pytest.fixture
def extension() -> Iterator[Extension]:
    with ExitStack() as exits:
        yield Extension(exits)


def test_blueos_finds_the_page_by_its_port_and_opens_it_outside_of_a_frame(
    extension: Extension,
) -> None:
    said = extension.metadata
    assert (said["sanitized_name"], said["version"]) == ("lindy", version("lindy"))
    assert said["works_in_relative_paths"] is True
    assert said["new_page"] is True
    assert Settings().port not in TAKEN


def test_the_whole_page_is_there_below_a_path(extension: Extension) -> None:
    page = extension.get("")
    assert "<title>Lindy cockpit</title>" in page
    assert '="/' not in page, "an address from the root is another page of BlueOS"
    assert extension.get("watch") == page
    for script in (DEPLOY.parent / "services" / "cockpit" / "page").glob("*.js"):
        text = extension.get(script.name)
        assert 'from "/' not in text
        assert 'fetch("/' not in text
        assert "fetch(`/" not in text
    with pytest.raises(urllib.error.HTTPError, match="404"):
        urllib.request.urlopen(f"http://127.0.0.1:{extension.outside}/main.js")


def test_its_sockets_open_below_the_path_for_its_own_page_alone(extension: Extension) -> None:
    page = extension.get("")
    number = page.partition('name="version" content="')[2].partition('"')[0]
    where = f"ws://{extension.path}ws/watch?version={number}&token="
    own = f"http://127.0.0.1:{extension.outside}"
    with connect(where, origin=own, compression=None):  # type: ignore[arg-type]
        until(lambda: [e for e in extension.server.received() if isinstance(e, PageOpened)])
    for origin in (f"http://127.0.0.1:{extension.settings.port}", "http://evil.example"):
        with (
            pytest.raises(InvalidStatus, match="403"),
            connect(where, origin=origin),  # type: ignore[arg-type]
        ):
            pass


def test_kraken_is_asked_for_the_hosts_network_and_for_no_power_over_it() -> None:
    wanted = asked_for(SAID["permissions"])
    host = wanted["HostConfig"]
    assert host["NetworkMode"] == "host"
    assert host["ReadonlyRootfs"]
    assert host["CapDrop"] == ["ALL"]
    assert "Privileged" not in host
    assert host["Binds"] == ["/usr/blueos/extensions/lindy:/data"]


def test_what_it_starts_is_a_dive_that_lindy_knows() -> None:
    text = FILE.read_text(encoding="utf-8").replace("\\\n", "")
    words: list[str] = json.loads(text.rpartition("CMD ")[2])
    assert words[0] == "dive"
    assert Registry.read(words[words.index("--stack") + 1])
    assert (DEPLOY / "vehicles" / f"{words[words.index('--vehicle') + 1]}.toml").is_file()
    sets = dict(words[k + 1].split("=", 1) for k, word in enumerate(words) if word == "--set")
    assert sets["cockpit.host"] == "0.0.0.0", "BlueOS looks at ports that others can reach"
    Settings(host=sets["cockpit.host"], insecure=sets["cockpit.insecure"] == "true")


def test_the_container_file_names_what_there_is() -> None:
    root = Path(DEPLOY).parent
    text = (root / "deploy" / "container" / "Containerfile").read_text(encoding="utf-8")
    project = tomllib.loads((root / "pyproject.toml").read_text(encoding="utf-8"))["project"]
    words = text.split()
    extras = {word for option, word in pairwise(words) if option == "--extra"}
    assert extras <= set(project["optional-dependencies"])
    assert "USER 10001:10001" in text
    assert "HEALTHCHECK" in text
