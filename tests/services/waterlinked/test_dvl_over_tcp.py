"""The driver and the double on a real connection; the time is the test's."""

from collections.abc import Iterator

import pytest

from messages.events import Outbox
from messages.sensors import DvlSample
from services.instruments.io.shell import Instrument, exchange, limits_of
from services.mavlink_io.io.links import Links
from services.waterlinked.core import DvlDriver, Settings
from tests.support.instruments.dvl import DvlSettings, report
from tests.support.instruments.ports import TcpInstrument
from tests.support.instruments.truth import SeenMotion
from tests.support.patience import until

S = 1_000_000_000  # [ns]
SWIMS = SeenMotion(velocity=(0.5, -0.2, 0.05), altitude=2.0)


class Board:
    """A driver on its connection."""

    def __init__(self, port: int) -> None:
        self.outbox = Outbox()
        self.driver = DvlDriver(Settings(url=f"tcp:127.0.0.1:{port}"), self.outbox)
        self.links = Links(
            [f"tcp:127.0.0.1:{port}"], "waterlinked.url", limits_of("dvl"), self.outbox
        )
        self.links.start(lambda: None)
        self.now = 100 * S
        self.samples = list[DvlSample]()

    def look(self) -> None:
        """A tenth of a second later."""
        self.now += S // 10
        self.samples += exchange(Instrument(self.driver, self.links), lambda: self.now, self.now)

    def hears(self, dvl: TcpInstrument, more: int = 3) -> bool:
        """What the DVL says now, until there are so many samples more."""
        wanted = len(self.samples) + more

        def enough() -> bool:
            dvl.says(report(SWIMS, self.now / S, 0))
            return len(self.samples) >= wanted

        return until(enough, meanwhile=self.look)


@pytest.fixture
def config() -> DvlSettings:
    return DvlSettings(acoustic_enabled=False)


@pytest.fixture
def dvl(config: DvlSettings) -> Iterator[TcpInstrument]:
    instrument = TcpInstrument(config.answers)
    yield instrument
    instrument.power_off()


@pytest.fixture
def board(dvl: TcpInstrument) -> Iterator[Board]:
    board = Board(dvl.port)
    yield board
    board.links.close()


def test_it_connects_hears_and_sets_up(
    dvl: TcpInstrument, board: Board, config: DvlSettings
) -> None:
    assert board.hears(dvl)
    until(lambda: config.config["acoustic_enabled"] is True, meanwhile=board.look)
    assert board.samples[0].velocity == pytest.approx(SWIMS.velocity, abs=0.03)


def test_one_that_loses_its_power_is_said_and_heard_again_when_it_is_back(
    dvl: TcpInstrument, board: Board
) -> None:
    board.hears(dvl)
    counts = board.outbox.counts
    dvl.power_off()
    until(lambda: counts["silent_instrument:dvl"] == 1, meanwhile=board.look)
    dvl.power_on()
    assert board.hears(dvl)
    assert counts["silent_instrument:dvl"] == 1
    assert counts["answering:dvl"] == 2
