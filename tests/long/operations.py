"""Which operations give the same bits on another processor: a hash of each one's results.

Run by tests/long/arm64.py on both, as a program; it needs numpy alone.
"""

import cmath
import hashlib
import json
import math
import random
import struct
import sys
from collections.abc import Callable, Iterable

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
MANY = 20_000


def digest(values: Iterable[float]) -> str:
    packed = b"".join(struct.pack("<d", value) for value in values)
    return hashlib.sha256(packed).hexdigest()[:12]


def drawn(low: float, high: float, count: int = MANY) -> list[float]:
    """The same everywhere: Mersenne Twister, and a product."""
    source = random.Random(7)
    return [low + (high - low) * source.random() for _ in range(count)]


def complex_parts(values: Iterable[complex]) -> list[float]:
    return [part for value in values for part in (value.real, value.imag)]


def of_math() -> dict[str, list[float]]:
    wide, unit, near = drawn(-10.0, 10.0), drawn(0.001, 0.999), drawn(-2.0, 2.0)
    one: dict[str, tuple[Callable[[float], float], list[float]]] = {
        "sqrt": (math.sqrt, unit), "sin": (math.sin, wide), "cos": (math.cos, wide),
        "tan": (math.tan, wide), "asin": (math.asin, unit), "acos": (math.acos, unit),
        "atan": (math.atan, wide), "exp": (math.exp, wide), "log": (math.log, unit),
        "sinh": (math.sinh, wide), "tanh": (math.tanh, near), "erf": (math.erf, near),
    }  # fmt: skip
    found = {name: [call(value) for value in values] for name, (call, values) in one.items()}
    pairs = list(zip(wide, reversed(wide), strict=True))
    found["atan2"] = [math.atan2(a, b) for a, b in pairs]
    found["hypot"] = [math.hypot(a, b, 0.3) for a, b in pairs]
    found["pow"] = [abs(a) ** b for a, b in pairs]
    found["fsum"] = [math.fsum((a, b, 1e-9)) for a, b in pairs]
    found["complex product"] = complex_parts(complex(a, b) * complex(b, 0.7) for a, b in pairs)
    found["complex exp"] = complex_parts(cmath.exp(complex(a, b)) for a, b in pairs)
    return found


def of_numpy() -> dict[str, list[float]]:
    values: Array = np.array(drawn(-2.0, 2.0))
    squares = values[: 64 * 36].reshape(64, 6, 6)
    small: list[Array] = [squares[i] for i in range(64)]
    right = values[:6]
    products: list[Array] = [a @ right for a in small]
    solved: list[NDArray[np.floating]] = [np.linalg.solve(a, right) for a in small]
    inverted: list[NDArray[np.floating]] = [np.linalg.pinv(a[:4]) for a in small]
    return {
        "numpy normal": np.random.default_rng(7).standard_normal(MANY).tolist(),
        "numpy sum": [float(values.sum())],
        "numpy exp": np.exp(values).tolist(),
        "numpy sin": np.sin(values).tolist(),
        "numpy product 6×6": np.concatenate([a @ a.T for a in small]).ravel().tolist(),
        "numpy product 6×1": np.concatenate(products).tolist(),
        "numpy solve": np.concatenate(solved).tolist(),
        "numpy pinv": np.concatenate(inverted).ravel().tolist(),
        "numpy pinv, 12 digits": (np.concatenate(inverted).round(12) + 0.0).ravel().tolist(),
    }


if __name__ == "__main__":
    json.dump({n: digest(v) for n, v in (of_math() | of_numpy()).items()}, sys.stdout)
