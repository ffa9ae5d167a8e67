"""Lines in a stream of bytes, as of JSON and NMEA."""

from collections.abc import Iterable


class LineCutter:
    """Keeps the rest of an unfinished line; never more than the longest one."""

    def __init__(self, longest: int) -> None:
        """`longest`: [bytes] of a line; what is longer is left out up to its end."""
        self._longest, self._rest, self._skips = longest, b"", False

    def lines(self, pieces: Iterable[bytes]) -> tuple[list[bytes], int]:
        """Whole lines in order without their ends, empty ones left out, and how many were too
        long."""
        *lines, rest = (self._rest + b"".join(pieces)).split(b"\n")
        if lines and self._skips:
            lines, self._skips = lines[1:], False
        kept = [line.strip() for line in lines if len(line) <= self._longest]
        too_long = len(lines) - len(kept)
        if len(rest) > self._longest:
            rest, too_long, self._skips = b"", too_long + (not self._skips), True
        self._rest = b"" if self._skips else rest
        return [line for line in kept if line], too_long
