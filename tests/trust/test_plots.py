"""What the pictures of docs/trust.md draw."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from tests.trust.consistency import Consistency
from tests.trust.nominal_passes import TIMES_S
from tests.trust.plots import by_horizon, consistency, reliability


@pytest.fixture
def axes() -> Any:
    from matplotlib.figure import Figure

    return Figure().subplots()


def test_a_calibrated_forecast_lies_on_the_diagonal(axes: Any) -> None:
    share = (np.arange(1000.0)[:, None] + 0.5) / 1000.0
    reliability(axes, [("honest", share, True), ("too low", share**2, False)])
    honest, low = axes.lines[1:]
    assert np.allclose(honest.get_xdata(), honest.get_ydata(), atol=2e-3)
    assert (low.get_ydata() >= honest.get_ydata() - 1e-9).all()
    assert honest.get_linewidth() > low.get_linewidth()


def test_bars_are_shares_in_percent(axes: Any) -> None:
    found = Consistency((), (), 0.1, 0.1, 0.1, 1.0, 0.5, 0.9, 1.0, 60.0, 50.0)
    consistency(axes, {"drive": found})
    assert [bar.get_width() for bar in axes.patches[:3]] == pytest.approx([50.0, 90.0, 100.0])


def test_errors_are_means_up_to_each_instant(axes: Any) -> None:
    by_horizon(axes, {"nominal": np.tile(TIMES_S, (3, 1))}, "drive")
    (line,) = axes.lines
    assert line.get_ydata()[-1] == pytest.approx(TIMES_S.mean())
    assert line.get_ydata()[0] == pytest.approx(TIMES_S[0])
