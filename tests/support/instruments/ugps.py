"""A double of the Underwater GPS G2, from its maker's page docs/underwater-gps/integration/api.md
(github.com/waterlinked/waterlinked.github.io) and the public description of the API it refers to.
Its topside stands at the origin and faces north."""

import json
import threading
from collections.abc import Generator
from contextlib import contextmanager
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from typing import Any, Literal

from services.instruments.core import GeoPoint
from services.ugps.core import ACOUSTIC, GLOBAL
from tests.support.instruments.truth import SeenMotion, drawn, latitude_longitude

Fault = Literal[
    "not_valid",
    "error",  # status 500
    "multipath",
    "nan",
    "negative",  # standard deviation
    "other_firmware",  # text in place of numbers
    "not_found",  # status 404: another server
    "other_device",
]


def answers(
    motion: SeenMotion, t: float, seed: int, origin: GeoPoint, faults: frozenset[Fault]
) -> dict[str, bytes]:
    """What it answers at `t` [s], or `HTTP` and the status. A position is new four times a
    second."""
    if faults & {"error", "not_found"}:
        status = b"HTTP 500" if "error" in faults else b"HTTP 404"
        return {ACOUSTIC: status, GLOBAL: status}
    random = drawn(seed, int(t * 4) / 4, "ugps")
    off = 15.0 if "multipath" in faults else 0.0
    x, y = (value + random.gauss(off, 0.3) for value in (motion.north, motion.east))
    valid, std = "not_valid" not in faults, -0.7 if "negative" in faults else 0.7
    lat, lon = latitude_longitude(origin, x, y)
    lists = {f"receiver_{name}": [0.0] * 4 for name in ("distance", "nsd", "rssi")}
    acoustic: dict[str, Any] = {
        "x": x, "y": y, "z": motion.depth, "std": std, "temp": 12.0, "position_valid": valid,
        "receiver_valid": [1] * 4, **lists,
    }  # fmt: skip
    place: dict[str, Any] = {
        "lat": float("nan") if "nan" in faults else lat, "lon": lon, "fix_quality": 1, "hdop": 1.1,
        "numsats": 11, "cog": -1, "sog": -1, "orientation": motion.heading,
    }  # fmt: skip
    if "other_device" in faults:
        acoustic = {"message": "Not found"}
    if "other_firmware" in faults:
        place["lat"] = f"{lat} N"
    return {ACOUSTIC: json.dumps(acoustic).encode(), GLOBAL: json.dumps(place).encode()}


@contextmanager
def served(pages: dict[str, bytes], port: int = 0) -> Generator[int]:
    """Its HTTP server with these pages, which may be changed; gives its port."""
    over = threading.Event()

    class Handler(BaseHTTPRequestHandler):
        protocol_version = "HTTP/1.1"

        def do_GET(self) -> None:
            if over.is_set():
                self.close_connection = True
                return
            body = pages.get(self.path, b"HTTP 404")
            failed = body.startswith(b"HTTP ")
            self.send_response(int(body[5:]) if failed else 200)
            self.send_header("Content-Length", str(len(body)))
            self.end_headers()
            self.wfile.write(body)

        def log_message(self, format: str, *args: Any) -> None:  # noqa: A002
            pass

    server = ThreadingHTTPServer(("127.0.0.1", port), Handler)
    server.daemon_threads = True
    thread = threading.Thread(target=server.serve_forever, args=(0.01,))
    thread.start()
    try:
        yield server.server_address[1]
    finally:
        over.set()  # also for connections that stand
        server.shutdown()
        thread.join()
        server.server_close()
