"""A double of a receiver of GNSS that speaks NMEA 0183: GGA, RMC and HDT with talker GN, as the
manuals of u-blox (UBX-18010854) lay them out."""

from typing import Literal

from services.instruments.core import GeoPoint
from tests.support.instruments.truth import SeenMotion, drawn, latitude_longitude

Fault = Literal[
    "no_fix",  # under water
    "frozen",  # it says the same again and again
    "estimated",  # quality 6: it extrapolates
    "multipath",  # off by 30 m
    "rmc_only",
    "bad_sum",
    "no_sum",
    "empty_hdop",
]


def summed(body: str) -> bytes:
    check = 0
    for letter in body:
        check ^= ord(letter)
    return f"${body}*{check:02X}\r\n".encode("ascii")


def epoch(
    motion: SeenMotion,
    t: float,
    seed: int,
    origin: GeoPoint,
    faults: frozenset[Fault] = frozenset(),
    hdop: float = 0.9,
) -> bytes:
    """All sentences of one measurement at `t` [s]."""
    t = 0.0 if "frozen" in faults else t
    random, found = drawn(seed, t, "gnss"), "no_fix" not in faults
    off = 30.0 if "multipath" in faults else 0.0
    north, east = (value + random.gauss(off, 0.5) for value in (motion.north, motion.east))
    latitude, longitude = latitude_longitude(origin, north, east)
    clock = f"{int(t // 3600) % 24:02d}{int(t // 60) % 60:02d}{t % 60:05.2f}"
    place = f"{_angle(latitude, 2, 'NS')},{_angle(longitude, 3, 'EW')}" if found else ",,,"
    quality = 0 if not found else 6 if "estimated" in faults else 1
    dilution = "" if "empty_hdop" in faults else f"{hdop if found else 99.99:.2f}"
    height = "1.2,M,40.1,M,," if found else ",M,,M,,"
    sentences = [
        f"GNGGA,{clock},{place},{quality},{9 if found else 0:02d},{dilution},{height}",
        f"GNRMC,{clock},{'A' if found else 'V'},{place},0.1,,191125,,,{'A' if found else 'N'}",
        f"GNHDT,{motion.heading:.1f},T",
        "GNGSA,A,3,,,,,,,,,,,,,1.8,0.9,1.5",
        "PUBX,04,101500.00,191125,1,2,3",  # of its maker's own
    ]
    if "rmc_only" in faults:
        sentences = sentences[1:]
    data = b"".join(map(summed, sentences))
    if "bad_sum" in faults:
        data = data.replace(b"*", b"*0")
    if "no_sum" in faults:
        data = b"".join(line.split(b"*")[0] + b"\r\n" for line in data.splitlines())
    return data


def _angle(degrees: float, digits: int, signs: str) -> str:
    whole, minutes = divmod(round(abs(degrees) * 60e5), 6_000_000)
    return f"{whole:0{digits}d}{minutes / 1e5:08.5f},{signs[degrees < 0]}"
