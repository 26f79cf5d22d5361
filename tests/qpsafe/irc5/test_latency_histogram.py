"""The histogram's percentiles are those of the times, to a bin; it never grows."""

import math

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from qpsafe.irc5.process.latency import RESOLUTION, Latency

TIMES = st.lists(st.floats(0.0, 0.3), min_size=1, max_size=200)


@given(TIMES, st.sampled_from([50.0, 99.0, 99.9, 100.0]))
def test_percentiles_against_sorting(times: list[float], percent: float) -> None:
    latency = Latency()
    for value in times:
        latency.record(value)
    exact = sorted(times)[max(math.ceil(percent / 100.0 * len(times)), 1) - 1]
    found = latency.percentile(percent)
    if exact < 0.1:
        assert exact - 1e-12 <= found <= exact + 2 * RESOLUTION
    else:
        assert found == max(times)
    assert latency.maximum == max(times)
    assert latency.count == len(times)
    assert sum(count for _, count in latency.decades()) == len(times)
    assert latency.above(0.004) == sum(value >= 0.004 for value in times) or any(
        abs(value - 0.004) <= RESOLUTION for value in times
    )


def test_a_clock_set_back_counts_as_nothing_and_memory_stays() -> None:
    latency = Latency()
    assert math.isnan(latency.percentile(50.0))
    before = latency._bins.nbytes
    for value in (-1.0, float("nan"), 0.0, 1e6):
        latency.record(value)
    assert latency.count == 4
    assert latency.maximum == 1e6
    assert latency.percentile(75.0) <= RESOLUTION
    assert latency._bins.nbytes == before
    assert np.array_equal(latency._bins.nonzero()[0], [0, len(latency._bins) - 1])
    latency.reset()
    assert latency.count == 0
    assert latency._bins.sum() == 0
