"""Real sockets and a pseudo-terminal: what arrives, what does not, and what cannot be opened."""

import os
import pty
import socket
import threading
import time
from contextlib import suppress
from pathlib import Path

import pytest

from messages.events import Outbox
from services.ardusub.service import ONE_BOARD
from services.mavlink_io.io.links import PAUSE_S, Links
from services.runtime.config.errors import LindyError
from tests.support.doors import free_port
from tests.support.patience import PATIENCE_S, until


def accept(board: socket.socket, accepted: list[socket.socket]) -> None:
    accepted.append(board.accept()[0])


class Board:
    """Links to one board, and what they lost."""

    def __init__(self, url: str) -> None:
        self.outbox = Outbox()
        self.links = Links([url], "ardusub.url", ONE_BOARD, self.outbox)
        self.close = self.links.close

    def receive(self) -> list[bytes]:
        return [piece for arrival in self.links.receive() for piece in arrival.pieces]

    def send(self, frame: bytes) -> None:
        for name in self.links.names:
            self.links.send(name, frame)

    def heard(self, length: int) -> bytes:
        """So many bytes, at least."""
        data = b""

        def enough() -> bool:
            nonlocal data
            data += b"".join(self.receive())
            return len(data) >= length

        until(enough, lambda: data)
        return data


@pytest.mark.parametrize(
    "url",
    ["", "udpin", "udpin:127.0.0.1", "udpin:127.0.0.1:x", "http:1.2.3.4:80", "tcp::5", "serial:7",
     "serial:/dev/null:115201", "udpin:127.0.0.1:99999",
     "udpin:no.such.host.invalid:14551"],
)  # fmt: skip
def test_a_link_that_cannot_be_opened_is_one_sentence(url: str) -> None:
    with pytest.raises(LindyError, match=r"allowed: (udpin:HOST:PORT|a name)") as error:
        Board(url)
    assert "\n" not in str(error.value)
    assert url in str(error.value)


def test_a_port_that_is_taken_is_said() -> None:
    port = free_port(socket.SOCK_DGRAM)
    link = Board(f"udpin:127.0.0.1:{port}")
    with pytest.raises(LindyError, match="another program has this port"):
        Board(f"udpin:127.0.0.1:{port}")
    link.close()


def test_udp_answers_the_board_and_leaves_others_alone() -> None:
    port = free_port(socket.SOCK_DGRAM)
    link = Board(f"udpin:127.0.0.1:{port}")
    link.send(b"nobody yet")
    with (
        socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as board,
        socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as other,
    ):
        board.settimeout(PATIENCE_S)
        board.sendto(b"one", ("127.0.0.1", port))
        assert link.heard(3) == b"one"
        other.sendto(b"stranger", ("127.0.0.1", port))
        board.sendto(b"two", ("127.0.0.1", port))
        assert link.heard(3) == b"two"
        link.send(b"answer")
        assert board.recv(100) == b"answer"
        assert link.outbox.counts == {"stranger:mavlink": 1}
    link.close()


def test_all_that_waits_is_read_at_once() -> None:
    port = free_port(socket.SOCK_DGRAM)
    link = Board(f"udpin:127.0.0.1:{port}")
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as board:
        sent = [bytes([n]) * 30 for n in range(200)]
        for datagram in sent:
            board.sendto(datagram, ("127.0.0.1", port))
        assert link.receive() == sent
    link.close()


def test_tcp_without_a_board_opens_and_counts_what_is_not_sent() -> None:
    link = Board(f"tcp:127.0.0.1:{free_port(socket.SOCK_STREAM)}")
    for _ in range(3):
        assert link.receive() == []
        link.send(b"x")
    assert link.outbox.counts == {"dropped:mavlink": 3}
    link.close()


def test_a_serial_port_passes_every_byte_as_it_is() -> None:
    master, slave = pty.openpty()
    link = Board(f"serial:{os.ttyname(slave)}:115200")
    every = bytes(range(256))
    os.write(master, every)
    assert link.heard(256) == every
    link.send(every)
    assert os.read(master, 1000) == every
    link.close()
    os.close(slave)
    os.close(master)


def test_whoever_started_it_is_told_of_every_arrival_and_a_flood_does_not_keep_it_busy() -> None:
    port = free_port(socket.SOCK_DGRAM)
    link = Board(f"udpin:127.0.0.1:{port}")
    told, heard = threading.Event(), list[bytes]()
    calls = [0]

    def notified() -> None:
        calls[0] += 1
        heard.extend(link.receive())
        told.set()

    link.links.start(notified)
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as board:
        for word in (b"one", b"two", b"three"):
            told.clear()
            board.sendto(word, ("127.0.0.1", port))
            assert told.wait(PATIENCE_S)
            assert heard[-1] == word
        before, began = calls[0], time.monotonic()
        while time.monotonic() < began + 0.2:
            board.sendto(b"x", ("127.0.0.1", port))
        assert calls[0] - before <= (time.monotonic() - began) / PAUSE_S + 1
    link.close()
    assert not [t for t in threading.enumerate() if t.name == "mavlink"]


def test_a_connection_made_anew_is_waited_for_as_well() -> None:
    with socket.socket(socket.AF_INET, socket.SOCK_STREAM) as board:
        board.bind(("127.0.0.1", 0))
        board.listen()
        board.settimeout(PATIENCE_S)
        link = Board(f"tcp:127.0.0.1:{board.getsockname()[1]}")
        told, lock, heard = threading.Event(), threading.Lock(), list[bytes]()

        def look() -> None:
            with lock:  # as a service does: one handler at a time
                heard.extend(link.receive())
            if heard:
                told.set()

        link.links.start(look)
        for word in (b"first", b"second"):
            accepted = list[socket.socket]()
            waiting = threading.Thread(target=accept, args=(board, accepted))
            waiting.start()

            # As its timer does; an attempt follows a second after a loss.
            until(lambda waiting=waiting: not waiting.is_alive(), meanwhile=look)
            with accepted[0] as end:
                heard.clear()
                told.clear()
                end.sendall(word)
                assert told.wait(PATIENCE_S)
                assert heard == [word]
        link.close()


def test_a_cable_that_was_pulled_is_opened_again_when_it_is_back(tmp_path: Path) -> None:
    device = tmp_path / "board"
    first, second = pty.openpty(), pty.openpty()
    device.symlink_to(os.ttyname(first[1]))
    another = os.ttyname(second[1])
    link = Board(f"serial:{device}:115200")
    for ends in (first, second):
        os.close(ends[1])
    os.close(first[0])  # pulled
    device.unlink()
    until(lambda: link.links.trouble, meanwhile=link.receive)
    link.send(b"lost")
    assert link.outbox.counts == {"dropped:mavlink": 1}
    device.symlink_to(another)

    def heard() -> list[bytes]:
        with suppress(OSError):
            os.write(second[0], b"back")
        return link.receive()

    assert b"".join(until(heard)).startswith(b"back")
    link.close()
    os.close(second[0])


def test_a_name_that_nobody_knows_is_refused_in_one_sentence() -> None:
    with pytest.raises(LindyError, match=r"no computer is known here by the name nobody\.invalid"):
        Links(["tcp:nobody.invalid:16171"], "ardusub.url", ONE_BOARD, Outbox())
