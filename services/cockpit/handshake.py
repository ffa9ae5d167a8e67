"""Who may open a page's connection: checked before a WebSocket is opened.

Any page that the pilot has open in a browser can try to open a WebSocket to this machine. The
browser says whose page it is (`Origin`) and which name it looked up (`Host`), which no page can
forge (RFC 6455, 10.2).
"""

import hashlib
import hmac
import ipaddress
from collections.abc import Sequence
from dataclasses import dataclass
from urllib.parse import parse_qs, urlsplit

# Names that no public name server answers for (RFC 6762, RFC 8375, and as routers give them). A
# page of another site can let its own name lead here (DNS rebinding), and then passes for this one.
NEAR = (".local", ".lan", ".home.arpa", ".internal", ".localhost")
LOOPBACK = ("127.0.0.1", "localhost", "[::1]")
PILOT, WATCH = "/ws/pilot", "/ws/watch"  # paths of the two kinds of WebSocket of a page
VIDEO = "/ws/video"  # and of the one for its picture, whichever page it is
SOCKETS = (PILOT, WATCH, VIDEO)


@dataclass(frozen=True, slots=True)
class Access:
    scheme: str  # http, https
    host: str  # where it listens
    port: int
    local: bool  # only this machine reaches it
    token: str = ""  # of the pilot; empty: none is asked for

    @property
    def watch_token(self) -> str:
        """Follows from the pilot's, and not the other way round."""
        return hashlib.sha256(f"watch {self.token}".encode()).hexdigest()[:22] if self.token else ""

    @property
    def address(self) -> str:
        host = f"[{self.host}]" if ":" in self.host else self.host
        return f"{self.scheme}://{host}:{self.port}/"

    @property
    def pilot_url(self) -> str:
        return f"{self.address}#{self.token}" if self.token else self.address

    @property
    def watch_url(self) -> str:
        return f"{self.address}watch" + (f"#{self.watch_token}" if self.token else "")

    def refusal(self, target: str, hosts: Sequence[str], origins: Sequence[str]) -> str:
        """Why a request is refused; empty when it is not.

        Args:
            target: path and query.
            hosts, origins: all values of these headers.
        """
        if len(hosts) != 1 or (self.local and not self._is_local(hosts[0])):
            return f"wrong Host: this page is at {self.address}"
        if not (self.local or self.token or _is_near(hosts[0])):
            return "wrong Host: open this page by the drone's address or its name in this network"
        path, _, query = target.partition("?")
        if path not in SOCKETS:
            return ""  # a file, which holds no secret
        if list(origins) != [f"{self.scheme}://{hosts[0]}"]:
            return f"wrong Origin: only the cockpit's own page may connect, at {self.address}"
        given = parse_qs(query).get("token", [""])[0]
        tokens = {PILOT: [self.token], WATCH: [self.watch_token]}
        wanted = tokens.get(path, [self.token, self.watch_token])
        if not any(hmac.compare_digest(given.encode(), token.encode()) for token in wanted):
            return "wrong token: open the address that the cockpit has printed"
        return ""

    def _is_local(self, host: str) -> bool:
        name, _, port = host.rpartition(":")
        return name in LOOPBACK and port == str(self.port)


def _is_near(host: str) -> bool:
    """An address, or a name of the network that the drone is in."""
    try:
        name = urlsplit(f"//{host}").hostname or ""
    except ValueError:  # brackets that enclose no address
        return False
    try:
        ipaddress.ip_address(name)
    except ValueError:
        return bool(name) and ("." not in name or name.endswith(NEAR))
    return True
