"""What is odd about a sensor is said with what follows, and nothing where nothing does."""

import numpy as np
import pytest

from messages import topics
from tools.review.recorded import SensorColumns
from tools.review.sensor_table import sensor_table


@pytest.mark.parametrize(
    ("hz", "words"),
    [(2.0, "fast motion is missed"), (45.0, "fast motion is missed"), (55.0, ""), (100.0, ""),
     (190.0, ""), (400.0, "takes longer")],
)  # fmt: skip
def test_a_rate_is_odd_beyond_a_factor_of_two(hz: float, words: str) -> None:
    t = np.arange(200) / hz
    imu = SensorColumns(t, t, np.random.default_rng(4).standard_normal((len(t), 6)), 0)
    (stream,) = sensor_table({topics.IMU.key: imu})
    assert len(stream.remarks) == bool(words)
    assert words in "".join(stream.remarks)
