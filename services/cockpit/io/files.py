"""The files of the page, as they are served."""

import gzip
import hashlib
from importlib.resources import files

import msgspec
from websockets.datastructures import Headers
from websockets.http11 import Response

from messages import events, version
from services import cockpit
from services.piloting.keys import KEYS

TYPES = {
    "html": "text/html; charset=utf-8",
    "css": "text/css; charset=utf-8",
    "js": "text/javascript; charset=utf-8",
    "json": "application/json",
    "svg": "image/svg+xml",
}
HEADERS = {
    # Nothing from elsewhere, and nobody may lay another page over the sticks.
    "Content-Security-Policy": "default-src 'self'; frame-ancestors 'none'; base-uri 'none'",
    "X-Content-Type-Options": "nosniff",
    "Referrer-Policy": "no-referrer",
    "Cache-Control": "no-store",
}
INDEX = "index.html"
ENGLISH = "words_en.json"  # the page's own sentences; those of events are added to them
VERSION = b"@VERSION@"  # stands in the page for the version
REGISTRATION = "register_service.json"  # by which BlueOS knows an extension's page
NAMES = {"/": INDEX, "/watch": INDEX, "/register_service": REGISTRATION}

# Events that are not said by themselves, and which the notice of a sensor in trouble is about.
TROUBLES = (events.SILENT, events.FROZEN, events.NOISY, events.DISTURBED)


def registration() -> dict[str, str | bool]:
    """What the file says, as of BlueOS' helper. The page is opened as a page of its own, below a
    path of BlueOS' server: in a frame nobody could be sure what lies over the sticks."""
    return {
        "name": "Lindy",
        "description": "The pilot leads, the drone follows, without a jerk",
        "icon": "mdi-controller",
        "company": "The Lindy authors",
        "version": version.VERSION,
        "webpage": "",
        "api": "",
        "new_page": True,
        "works_in_relative_paths": True,
    }


def sentences() -> dict[str, str]:
    """The English of all events that a page says, from the event table. A condition is said alike
    when it is noticed and when it acts."""
    said = [row for row in events.ALL.values() if row.said in ("warning", "error")]
    found = {row.name: row.sentence for row in said if row.kind != events.FAILSAFE_ACTED.kind}
    found |= events.TOLD | {row.name: row.sentence for row in TROUBLES}
    for condition in events.CONDITIONS.values():
        if condition.acted.short:  # one that acts, said in four lines
            found[f"{condition.noticed.name}.short"] = condition.acted.short
            found[f"{condition.noticed.name}.do"] = condition.acted.to_do
    return found


class PageFiles:
    """Read once: what is served is what was there at the start."""

    def __init__(self) -> None:
        folder = files(cockpit) / "page"
        self.contents = {
            entry.name: entry.read_bytes()
            for entry in folder.iterdir()
            if entry.name.rpartition(".")[2] in TYPES
        }
        for name in [name for name in self.contents if name.endswith(".json")]:
            said = msgspec.json.decode(self.contents[name])
            said = sentences() | said if name == ENGLISH else said
            self.contents[name] = msgspec.json.encode(said)
        # Their sentences are in the page's languages.
        keys = [{"action": key.action, "codes": key.codes, "kind": key.kind} for key in KEYS]
        self.contents["keys.json"] = msgspec.json.encode(keys)
        self.contents[REGISTRATION] = msgspec.json.encode(registration())
        everything = b"".join(self.contents[name] for name in sorted(self.contents))
        self.version = hashlib.sha256(everything).hexdigest()[:12]
        self.contents[INDEX] = self.contents[INDEX].replace(VERSION, self.version.encode())
        self.packed = {name: gzip.compress(body) for name, body in self.contents.items()}

    def response(self, path: str, encodings: str = "") -> Response:
        """A page or a module of it; 404 for everything else.

        Args:
            encodings: that the browser accepts, the header Accept-Encoding.
        """
        name = NAMES.get(path, path.removeprefix("/"))
        if name not in self.contents:
            return plain(404, "Not Found", "there is no such page")
        kind = TYPES[name.rpartition(".")[2]]
        if "gzip" not in encodings:
            return _response(200, "OK", kind, self.contents[name])
        response = _response(200, "OK", kind, self.packed[name])
        response.headers["Content-Encoding"] = "gzip"
        return response


def plain(status: int, reason: str, sentence: str) -> Response:
    return _response(status, reason, "text/plain; charset=utf-8", f"{sentence}\n".encode())


def _response(status: int, reason: str, kind: str, body: bytes) -> Response:
    headers = Headers(HEADERS)
    headers["Content-Type"] = kind
    headers["Content-Length"] = str(len(body))
    headers["Connection"] = "close"
    return Response(status, reason, headers, body)
