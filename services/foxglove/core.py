"""What is shown besides messages: the settings of the dive, as parameters that nobody can set; and
who may open a connection. Pure.

The SDK's server takes anybody, also any page that the pilot has open in a browser. The browser says
whose page it is (`Origin`), and by which name it has looked this server up (`Host`), which no page
can forge (RFC 6455, 10.2).
"""

from collections.abc import Iterator, Mapping
from typing import Annotated, Any, cast

import msgspec

LOOPBACK = ("127.0.0.1", "::1", "localhost")
IN_URLS = ("127.0.0.1", "localhost", "[::1]")
# The web pages of viewers; a program of this machine says no Origin, or one that no web page has.
VIEWERS = ("https://app.foxglove.dev", "https://lichtblick.dev")
SCHEMES = ("file", "app", "vscode-webview", "lichtblick", "foxglove")
Value = bool | int | float | str


class Settings(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """The table [foxglove] of a vehicle file."""

    host: str = "127.0.0.1"  # address to listen on: only this machine; 0.0.0.0 is everywhere
    port: Annotated[int, msgspec.Meta(ge=1, le=65535)] = 8765


def parameters(tree: Mapping[str, Any]) -> dict[str, Value]:
    """The settings of a vehicle file by their dotted names; entries of an array are numbered
    from 0."""
    return dict(_flat("", tree))


def _flat(name: str, value: Any) -> Iterator[tuple[str, Value]]:
    if isinstance(value, Mapping):
        inner = cast(Mapping[str, Any], value).items()
    elif isinstance(value, list | tuple):
        inner = enumerate(cast(list[Any], value))
    else:
        yield name, value if isinstance(value, Value) else str(value)
        return
    for key, part in inner:
        yield from _flat(f"{name}.{key}" if name else str(key), part)


def refusal(head: bytes, port: int, *, local: bool) -> str:
    """Why a request is refused; empty where it is not.

    Args:
        head: of an HTTP request, with its last empty line.
        local: only this machine reaches the server.
    """
    request, *lines = head.decode("latin-1").split("\r\n")
    if not request.startswith("GET ") or not request.endswith(" HTTP/1.1"):
        return "this is no request for a WebSocket"
    fields = [line.partition(":") for line in lines if line]
    hosts = [value.strip() for name, _, value in fields if name.lower() == "host"]
    origins = [value.strip() for name, _, value in fields if name.lower() == "origin"]
    if len(hosts) != 1 or (local and not _is_local(hosts[0], port)):
        return f"wrong Host: this server is at localhost:{port}"
    if any(not _is_viewer(origin) for origin in origins):
        return "wrong Origin: only Foxglove and Lichtblick may connect"
    return ""


def _is_local(host: str, port: int) -> bool:
    name, _, number = host.rpartition(":")
    return name in IN_URLS and number == str(port)


def _is_viewer(origin: str) -> bool:
    scheme, _, place = origin.partition("://")
    own_page = scheme == "http" and (place in IN_URLS or place.rpartition(":")[0] in IN_URLS)
    return origin in VIEWERS or scheme in SCHEMES or own_page
