"""Which of the drone's cameras is large on every page, and what the pages film. Pure.

The page with the sticks decides; where nobody has them, any page that may fly. The choice is sent
at once, and again every second while this pilot has control, so that a lost message heals; nothing
of it waits anywhere. Without a pilot the last choice stays. While this pilot does not have control,
another one's choice counts, as the cameras on board say it.

A film runs once the recorder on board has said that it has it.
"""

from collections.abc import Mapping
from dataclasses import dataclass, field
from math import degrees

from messages.cameras import FIRST
from messages.units import Ns
from messages.video import CameraChoice, CameraShares, FilmAnswer, FilmKind, FilmRequest
from services.cockpit.page_messages import PageWish
from services.marine.field_of_view import FieldOfView

REPEAT_NS = 1_000_000_000  # [ns]
ANSWERED_NS = 2_000_000_000  # [ns] for the choice to reach the cameras, and their word to come back
FRESH_NS = 1_000_000_000  # [ns] what the cameras said longer ago is not shown
FRONT = {FIRST: FieldOfView()}  # a drone with one camera, which looks ahead


@dataclass(slots=True)
class Cameras:
    """The cameras as one cockpit shows them."""

    views: Mapping[str, FieldOfView] = field(default_factory=lambda: FRONT)  # first one first
    source: str = ""  # who chooses
    large: str = FIRST
    _known: bool = False  # chosen here, or said on board
    _chosen_ns: Ns = -ANSWERED_NS
    _sent_ns: Ns = 0
    _said: CameraShares | None = None
    _said_ns: Ns = 0

    @property
    def several(self) -> bool:
        return len(self.views) > 1

    def choose(self, name: str, now: Ns) -> CameraChoice | str:
        """What is to be sent; or why nothing is."""
        if name not in self.views:
            return f"there is no camera {name!r}; known: {', '.join(self.views)}"
        self.large, self._known, self._chosen_ns = name, True, now
        return self._choice(now)

    def told(self, said: CameraShares, now: Ns, *, in_control: bool) -> None:
        """The large camera on board says what each may send."""
        self._said, self._said_ns = said, now
        waits = now < self._chosen_ns + ANSWERED_NS
        decides = self._known and (in_control or waits)
        if said.large in self.views and not decides:
            self.large, self._known = said.large, True

    def repeated(self, now: Ns, *, in_control: bool) -> CameraChoice | None:
        """The choice again, where it is due. Also without control where no camera on board says
        that it is large: one that was started anew has forgotten it."""
        silent = self._said is not None and now >= self._said_ns + ANSWERED_NS
        due = self.several and self._known and (in_control or silent)
        return self._choice(now) if due and now >= self._sent_ns + REPEAT_NS else None

    def roomless(self, name: str, now: Ns) -> bool:
        """Does it send nothing because the link has no room for it?"""
        said = self._said
        fresh = said is not None and now < self._said_ns + FRESH_NS
        return fresh and said is not None and said.kbit.get(name) == 0.0

    def looks(self, tilt_deg: float | None) -> tuple[float, float]:
        """[deg] Tilt and yaw of the large camera's axis.

        Args:
            tilt_deg: [deg] the pilot's tilt of the first camera; None: not known.
        """
        view = self.views[self.large]
        tilted = (tilt_deg or 0.0) if self.large == FIRST else 0.0
        return round(degrees(view.tilt) + tilted, 1), round(degrees(view.yaw), 1)

    def _choice(self, now: Ns) -> CameraChoice:
        self._sent_ns = now
        return CameraChoice(stamp_ns=now, camera=self.large, source=self.source)


@dataclass(slots=True)
class Filming:
    source: str
    since_ns: Ns | None = None  # [ns] when the film that runs began; None: none runs
    snapshots: int = 0  # taken, and recorded
    light_ns: Ns | None = None  # [ns] stamp of the newest picture that pages were sent
    camera: str = ""  # that is filmed: the large one; empty: there is one only
    _waiting: FilmKind | None = None  # begin or end, and it is not answered yet

    def wish(self, wish: PageWish) -> FilmRequest | str:
        """The request to be made; or why there is none."""
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
