"""Who may open a connection to Foxglove's server. Pure.

The SDK's server takes anybody, also any page that the pilot has open in a browser. The browser says
whose page it is (`Origin`), and by which name it has looked this server up (`Host`), which no page
can forge (RFC 6455, 10.2).
"""

LOOPBACK = ("127.0.0.1", "localhost", "[::1]")
# The web pages of viewers; a program of this machine says no Origin, or one that no web page has.
VIEWERS = ("https://app.foxglove.dev", "https://lichtblick.dev")
SCHEMES = ("file", "app", "vscode-webview", "lichtblick", "foxglove")


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
    return name in LOOPBACK and number == str(port)


def _is_viewer(origin: str) -> bool:
    scheme, _, place = origin.partition("://")
    own_page = scheme == "http" and (place in LOOPBACK or place.rpartition(":")[0] in LOOPBACK)
    return origin in VIEWERS or scheme in SCHEMES or own_page
