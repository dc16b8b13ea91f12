"""Series for the page keep peaks and resolution."""

from __future__ import annotations

import base64

import numpy as np
import pytest

from ir_recorder.report.series import envelope, quantised


def test_an_envelope_keeps_every_peak() -> None:
    time = np.arange(100_000) * 0.01
    value = np.zeros(100_000)
    value[[7, 50_123]] = 9.0, -4.0
    shape = envelope(time, value, 1000)
    assert len(shape.time) == 1000
    assert (shape.high.max(), shape.low.min()) == (9.0, -4.0)
    assert shape.time[int(np.argmax(shape.high))] == pytest.approx(0.07, abs=1.0)


def test_quantised_numbers_keep_half_a_step() -> None:
    values = np.linspace(-6.2, 6.2, 1001)
    back = np.frombuffer(base64.b64decode(quantised(values, 2e-4)), dtype="<i2") * 2e-4
    assert np.abs(back - values).max() <= 1.0001e-4


def test_values_beyond_the_range_are_clipped() -> None:
    back = np.frombuffer(
        base64.b64decode(quantised([np.inf, -1e308, np.nan, 2.0], 1e-3)), dtype="<i2"
    )
    assert back.tolist() == [32767, -32768, 0, 2000]
