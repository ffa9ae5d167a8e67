"""What the pages film. Pure: a film runs once the recorder on board has said that it has it."""

from dataclasses import dataclass

from messages.film import FilmAnswer, FilmKind, FilmRequest
from messages.units import Ns
from services.cockpit.page_messages import PageWish

PATIENCE_NS = 1_000_000_000  # [ns] an older wish is not carried out: it waited in a network


@dataclass(slots=True)
class Filming:
    source: str
    since_ns: Ns | None = None  # [ns] when the film that runs began; None: none runs
    snapshots: int = 0  # taken, and recorded
    light_ns: Ns | None = None  # [ns] stamp of the newest picture that pages were sent
    camera: str = ""  # that is filmed: the large one; empty: there is one only
    _waiting: FilmKind | None = None  # begin or end, and it is not answered yet

    def wish(self, wish: PageWish, read_ns: Ns, now: Ns) -> FilmRequest | str:
        """The request to be made; or why there is none."""
        if now > read_ns + PATIENCE_NS:
            return "it came too late"
        if self.light_ns is None:
            return "there is no picture"
        if wish.what == "snapshot":
            return self._request("snapshot", self.light_ns)
        if self._waiting is not None:
            return "the one before is not answered yet"
        self._waiting = "begin" if self.since_ns is None else "end"
        return self._request(self._waiting, self.light_ns)

    def answered(self, request: FilmRequest, answer: FilmAnswer, now: Ns) -> None:
        if request.kind == "snapshot":
            self.snapshots += answer.accepted
            return
        self._waiting = None
        if request.kind == "end":  # also where it was not recorded: nothing is
            self.since_ns = None
        elif answer.accepted:
            self.since_ns = now

    def given_up(self, request: FilmRequest) -> None:
        if request.kind != "snapshot":
            self._waiting = None

    def seconds(self, now: Ns) -> float | None:
        """[s] That the film runs; None: none does."""
        return None if self.since_ns is None else (now - self.since_ns) / 1e9

    def _request(self, kind: FilmKind, light_ns: Ns) -> FilmRequest:
        return FilmRequest(
            stamp_ns=0,
            id="",
            kind=kind,
            light_ns=light_ns,
            source=self.source,
            camera=self.camera,
        )
