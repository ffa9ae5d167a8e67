"""From input channels to motor pulses, as measured; written apart from the driver's mixer."""

from collections.abc import Mapping, Sequence

from services.ardusub.mixing import FRAMES

SPOOL_S = 0.52  # [s] from arming to thrust, MOT_SPOOL_TIME 0.5; then at once
REST = 1500  # [µs] of a motor, armed or not


def norm_input(pulse: float, params: Mapping[str, float], channel: int) -> float:
    """[-] -1 … 1, without a dead band."""
    least, trim, most = (params[f"RC{channel}_{part}"] for part in ("MIN", "TRIM", "MAX"))
    if pulse > trim:
        value = (pulse - trim) / (most - trim)
    else:
        value = (pulse - trim) / (trim - least) if trim > least else 0.0
    value = -value if params[f"RC{channel}_REVERSED"] else value
    return max(-1.0, min(1.0, value))


def axes_of(pulses: Sequence[float], params: Mapping[str, float], version: str) -> list[float]:
    """[-] Roll, pitch, yaw, throttle (up), forward, lateral, from the channels 1 to 6 [µs]."""
    pitch, roll, throttle, yaw, forward, lateral = (
        norm_input(pulse, params, n) for n, pulse in enumerate(pulses, 1)
    )
    from_zero = throttle if version == "4.5" else (throttle + 1.0) / 2.0
    return [
        roll,
        pitch,
        yaw * params["ACRO_YAW_P"] / 3.375,
        2.0 * from_zero - 1.0,
        forward,
        lateral,
    ]


def motor_pulses(axes: Sequence[float], params: Mapping[str, float]) -> list[int]:
    """[µs] Per motor."""
    frame = FRAMES[int(params["FRAME_CONFIG"])]
    roll, pitch, yaw, throttle, forward, lateral = axes
    outputs: list[float] = []
    if frame is FRAMES[2]:  # each group of axes is scaled to its largest motor
        rises = [m[0] * roll + m[1] * pitch + m[3] * throttle for m in frame.motors]
        glides = [m[2] * yaw + m[4] * forward + m[5] * lateral for m in frame.motors]
        most_up, most_along = max(1.0, *map(abs, rises)), max(1.0, *map(abs, glides))
        outputs = [a / most_up + b / most_along for a, b in zip(rises, glides, strict=True)]
    else:
        for number, m in enumerate(frame.motors):
            ahead = m[4] * forward
            if frame.coupled and number in (2, 3):  # the rear pair
                room = max(0.0, 1.0 - params["MOT_FV_CPLNG_K"] * abs(throttle))
                ahead = max(-room, min(room, ahead))
            rest = m[0] * roll + m[1] * pitch + m[2] * yaw + m[3] * throttle + m[5] * lateral
            outputs.append(max(-1.0, min(1.0, rest + ahead)))
    return [
        round(REST + 400.0 * max(-1.0, min(1.0, value)) * params[f"MOT_{n}_DIRECTION"])
        for n, value in enumerate(outputs, 1)
    ]
