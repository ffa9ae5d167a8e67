"""What BlueOS does with an extension, written from its public sources (core/services/helper and
kraken, core/tools/nginx, and the BlueOS-Extensions-Repository): it reads the labels of the image,
asks every port for /register_service, and serves the page below /extensionv2/<name>/."""

import asyncio
import json
import re
import threading
import urllib.request
from collections.abc import Generator
from contextlib import closing, contextmanager, suppress
from pathlib import Path
from typing import Any

TYPES = ("device-integration", "example", "theme", "other", "tool", "education")
NEEDED = ("name", "description", "icon", "company", "version", "webpage", "api")
KNOWN = (
    *NEEDED, "route", "new_page", "extra_query", "avoid_iframes", "sanitized_name",
    "works_in_relative_paths", "extras",
)  # fmt: skip
TAKEN = {  # ports of BlueOS itself
    22, 80, 81, 2748, 2770, 5201, 5555, 5777, 6020, 6021, 6030, 6040, 7000, 7777, 8000, 8081, 8088,
    8554, 9000, 9002, 9090, 9100, 9101, 9110, 9111, 9120, 9134, 9150, 9152, 27353,
}  # fmt: skip


def labels(dockerfile: Path) -> dict[str, str]:
    """LABEL lines, as Docker joins them."""
    text = dockerfile.read_text(encoding="utf-8").replace("\\\n", "")
    found = re.findall(r"^LABEL (\w+)=(['\"])(.*)\2$", text, re.MULTILINE)
    return {name: value for name, _, value in found}


def asked_for(permissions: str) -> dict[str, Any]:
    """What Kraken hands to Docker's call to create a container."""
    return json.loads(permissions)


def registered(port: int) -> dict[str, Any]:
    """The metadata of a port, checked as the helper's model does."""
    asked = urllib.request.Request(
        f"http://127.0.0.1:{port}/register_service",
        headers={"Accept": "application/json", "User-Agent": "python"},
    )
    with urllib.request.urlopen(asked, timeout=5.0) as answer:
        found = json.loads(answer.read().decode())
    assert set(found) <= set(KNOWN)
    assert all(isinstance(found[name], str) for name in NEEDED)
    return {**found, "sanitized_name": re.sub(r"[^a-z0-9]", "", found["name"].lower())}


@contextmanager
def proxy(name: str, behind: int) -> Generator[int]:
    """Its nginx: /extensionv2/<name>/ becomes / at the port behind, and everything has the header
    `Connection: Upgrade`. Gives its own port. BlueOS' is 80, so that there Host has none."""
    loop, started = asyncio.new_event_loop(), threading.Event()
    server, stop = list[asyncio.Server](), asyncio.Event()
    prefix = f"/extensionv2/{name}/".encode()

    async def met(reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        with suppress(OSError, asyncio.IncompleteReadError), closing(writer):
            head = await reader.readuntil(b"\r\n\r\n")
            method, path, rest = head.split(b" ", 2)
            if not path.startswith(prefix):
                writer.write(b"HTTP/1.1 404 Not Found\r\nContent-Length: 0\r\n\r\n")
                return
            inner, outer = await asyncio.open_connection("127.0.0.1", behind)
            rest = re.sub(rb"(?mi)^connection: .*\r\n", b"", rest)
            line = b" ".join((method, b"/" + path.removeprefix(prefix), rest))
            with closing(outer):
                outer.write(line.removesuffix(b"\r\n") + b"Connection: Upgrade\r\n\r\n")
                await asyncio.gather(passed(reader, outer), passed(inner, writer))

    async def passed(reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        with suppress(OSError):
            while data := await reader.read(65_536):
                writer.write(data)
            writer.close()

    async def serve() -> None:
        server.append(await asyncio.start_server(met, "127.0.0.1", 0))
        started.set()
        await stop.wait()
        server[0].close()
        others = [task for task in asyncio.all_tasks() if task is not asyncio.current_task()]
        for task in others:
            task.cancel()
        await asyncio.gather(*others, return_exceptions=True)

    def run() -> None:
        with asyncio.Runner(loop_factory=lambda: loop) as runner:
            runner.run(serve())

    thread = threading.Thread(target=run, daemon=True)
    thread.start()
    started.wait()
    yield server[0].sockets[0].getsockname()[1]
    loop.call_soon_threadsafe(stop.set)
    thread.join()
