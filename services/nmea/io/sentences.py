"""Sentences of NMEA 0183 as plain values, by pynmea2."""

import importlib
from typing import Any

from services.nmea.core import GnssSentence
from services.runtime.config.errors import LindyError
from services.runtime.config.extras import how_to_install


class NmeaReader:
    def __init__(self) -> None:
        """
        Raises:
            LindyError: pynmea2 is not installed.
        """
        try:
            self._nmea: Any = importlib.import_module("pynmea2")
        except ImportError:
            why = f"NMEA needs pynmea2, which is not installed; {how_to_install('instruments')}"
            raise LindyError(why) from None

    def read(self, line: bytes) -> GnssSentence | None:
        """None: it has no check sum or a wrong one, or is no sentence."""
        try:
            said = self._nmea.parse(line.decode("ascii"), check=True)
            return self._values(said)
        except self._nmea.SentenceTypeError:  # whole, and of a kind that pynmea2 does not know
            return GnssSentence("")
        except (self._nmea.ParseError, ValueError, TypeError, AttributeError):
            return None

    def _values(self, said: Any) -> GnssSentence:
        kind = str(getattr(said, "sentence_type", ""))
        if kind not in ("GGA", "RMC"):
            return GnssSentence(kind)
        clock = str(said.timestamp or "")
        if not (said.lat and said.lon):
            return GnssSentence(kind, clock)
        if kind == "RMC":
            return GnssSentence(kind, clock, (said.latitude, said.longitude), said.status == "A")
        hdop = float(said.horizontal_dil) if said.horizontal_dil else None
        quality = int(said.gps_qual or 0)
        return GnssSentence(kind, clock, (said.latitude, said.longitude), quality, hdop)
