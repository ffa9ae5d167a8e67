"""Real sockets and a pseudo-terminal: what arrives, what does not, and what cannot be opened."""

import os
import pty
import socket
import threading
import time
from collections.abc import Callable

import pytest

from services.ardusub.io.link import BoardLink, open_link
from services.ardusub.io.watch import PAUSE_S
from services.runtime.config.errors import LindyError

PATIENCE_S = 10.0


def free_port(kind: socket.SocketKind = socket.SOCK_DGRAM) -> int:
    with socket.socket(socket.AF_INET, kind) as probe:
        probe.bind(("127.0.0.1", 0))
        return probe.getsockname()[1]


def accept(board: socket.socket, accepted: list[socket.socket]) -> None:
    accepted.append(board.accept()[0])


def until(link: BoardLink, enough: Callable[[bytes], bool]) -> bytes:
    data, end = b"", time.monotonic() + PATIENCE_S
    while not enough(data) and time.monotonic() < end:
        data += b"".join(link.receive())
        time.sleep(0.002)  # for the other end, which the system runs
    return data


@pytest.mark.parametrize(
    "url",
    ["", "udpin", "udpin:127.0.0.1", "udpin:127.0.0.1:x", "http:1.2.3.4:80", "tcp::5", "serial:7",
     "serial:/dev/null:115201", "udpin:127.0.0.1:99999",
     "udpin:no.such.host.invalid:14551"],
)  # fmt: skip
def test_a_link_that_cannot_be_opened_is_one_sentence(url: str) -> None:
    with pytest.raises(LindyError, match="allowed: udpin:HOST:PORT") as error:
        open_link(url)
    assert "\n" not in str(error.value)
    assert url in str(error.value)


def test_a_port_that_is_taken_is_said() -> None:
    port = free_port()
    link = open_link(f"udpin:127.0.0.1:{port}")
    with pytest.raises(LindyError, match="another program has this port"):
        open_link(f"udpin:127.0.0.1:{port}")
    link.close()


def test_udp_answers_the_board_and_leaves_others_alone() -> None:
    port = free_port()
    link = open_link(f"udpin:127.0.0.1:{port}")
    link.send(b"nobody yet")
    with (
        socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as board,
        socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as other,
    ):
        board.settimeout(PATIENCE_S)
        board.sendto(b"one", ("127.0.0.1", port))
        assert until(link, lambda d: d == b"one") == b"one"
        other.sendto(b"stranger", ("127.0.0.1", port))
        board.sendto(b"two", ("127.0.0.1", port))
        assert until(link, lambda d: d == b"two") == b"two"
        link.send(b"answer")
        assert board.recv(100) == b"answer"
        assert link.lost() == (1, 0)
        assert link.lost() == (0, 0)
    link.close()


def test_a_flood_is_read_in_bounded_parts() -> None:
    port = free_port()
    link = open_link(f"udpin:127.0.0.1:{port}")
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as board:
        for _ in range(150):
            board.sendto(b"x" * 1000, ("127.0.0.1", port))
        assert 0 < len(link.receive()) <= 64
    link.close()


def test_tcp_connects_again_after_the_board_was_lost() -> None:
    with socket.socket(socket.AF_INET, socket.SOCK_STREAM) as board:
        board.bind(("127.0.0.1", 0))
        board.listen()
        board.settimeout(PATIENCE_S)
        link = open_link(f"tcp:127.0.0.1:{board.getsockname()[1]}")
        for word in (b"first", b"second"):
            accepted = list[socket.socket]()
            waiting = threading.Thread(target=accept, args=(board, accepted))
            waiting.start()
            while waiting.is_alive():
                link.receive()
                time.sleep(0.01)  # for the attempt that follows a second after a loss
            with accepted[0] as end:
                end.sendall(word)
                assert until(link, lambda d, word=word: d == word) == word
                link.send(b"down")
                assert end.recv(100) == b"down"
        link.close()


def test_tcp_without_a_board_opens_and_counts_what_is_not_sent() -> None:
    link = open_link(f"tcp:127.0.0.1:{free_port(socket.SOCK_STREAM)}")
    for _ in range(3):
        assert link.receive() == []
        link.send(b"x")
    assert link.lost() == (0, 3)
    link.close()


def test_a_serial_port_passes_every_byte_as_it_is() -> None:
    master, slave = pty.openpty()
    link = open_link(f"serial:{os.ttyname(slave)}:115200")
    every = bytes(range(256))
    os.write(master, every)
    assert until(link, lambda d: len(d) >= 256) == every
    link.send(every)
    assert os.read(master, 1000) == every
    link.close()
    os.close(slave)
    os.close(master)


def test_whoever_started_it_is_told_of_every_arrival_and_a_flood_does_not_keep_it_busy() -> None:
    port = free_port()
    link = open_link(f"udpin:127.0.0.1:{port}")
    told, heard = threading.Event(), list[bytes]()
    calls = [0]

    def notified() -> None:
        calls[0] += 1
        heard.extend(link.receive())
        told.set()

    link.start(notified)
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
    assert not [t for t in threading.enumerate() if t.name == "board"]


def test_a_connection_made_anew_is_waited_for_as_well() -> None:
    with socket.socket(socket.AF_INET, socket.SOCK_STREAM) as board:
        board.bind(("127.0.0.1", 0))
        board.listen()
        board.settimeout(PATIENCE_S)
        link = open_link(f"tcp:127.0.0.1:{board.getsockname()[1]}")
        told, lock, heard = threading.Event(), threading.Lock(), list[bytes]()

        def look() -> None:
            with lock:  # as a service does: one handler at a time
                heard.extend(link.receive())
            if heard:
                told.set()

        link.start(look)
        for word in (b"first", b"second"):
            accepted = list[socket.socket]()
            waiting = threading.Thread(target=accept, args=(board, accepted))
            waiting.start()
            while waiting.is_alive():
                look()  # as its timer does
                time.sleep(0.01)  # for the attempt that follows a second after a loss
            with accepted[0] as end:
                heard.clear()
                told.clear()
                end.sendall(word)
                assert told.wait(PATIENCE_S)
                assert heard == [word]
        link.close()
