"""The table [ardusub] of a vehicle file."""

from typing import Annotated

import msgspec

Id = Annotated[int, msgspec.Meta(ge=1, le=255)]
Timeout = Annotated[float, msgspec.Meta(ge=0.1, le=3.0)]


class Settings(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    # udpin:HOST:PORT and tcpin:HOST:PORT wait for the board, udpout:HOST:PORT and tcp:HOST:PORT
    # call it, serial:DEVICE:BAUD is a cable.
    url: Annotated[str, msgspec.Meta(max_length=200)] = "udpin:127.0.0.1:14551"
    system: Id = 255  # [-] ours, as a ground station: the board's SYSID_MYGCS or MAV_GCS_SYSID
    component: Id = 191  # [-] ours: an onboard computer
    board: Id = 1  # [-] system of the board
    pressure_rate: Annotated[float, msgspec.Meta(ge=1.0, le=100.0)] = 40.0  # [1/s] asked for
    # Of a value that the board has just taken over: half of the 100 ms of which it is the mean,
    # less the delay of its filter for the IMU (20 Hz).
    pressure_age: Annotated[float, msgspec.Meta(ge=0.0, le=0.3)] = 0.04  # [s]
    compass_age: Annotated[float, msgspec.Meta(ge=0.0, le=0.3)] = 0.04  # [s] the same
    # May Lindy set FS_PILOT_TIMEOUT to this? None: it only says that a second or less is better.
    set_pilot_timeout: Timeout | None = None  # [s]
    disarm_after: Annotated[float, msgspec.Meta(ge=0.2, le=60.0)] = 2.0  # [s] without commands
    tilt_range: Annotated[float, msgspec.Meta(gt=0.0, le=3.2)] | None = 0.785  # [rad] None: no tilt
    # 4.8 has no channel for the lights: number of a servo output that is free for DO_SET_SERVO.
    light_servo: Annotated[int, msgspec.Meta(ge=1, le=32)] | None = None
