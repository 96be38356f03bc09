"""What came of a round's forecast does not depend on when its futures came."""

from __future__ import annotations

import pytest

from foretwin.contracts.forecast import ForecastOutcome
from tests.orchestrator.futures_rounds import round_done, straight
from tests.orchestrator.rounds.test_progress_forecasts import FRAME, INTENT, fresh, state
from tests.orchestrator.trip import START_NS


@pytest.mark.parametrize("answered", [16, 27, 95])
def test_a_round_that_completes_late_is_held_against_what_came_at_its_instants(
    answered: int,
) -> None:
    """Of a car that brakes from 12 m/s at 4 m/s²: after 1 s it has gone 10 m."""
    late, at_once = fresh(), fresh()
    found: tuple[list[ForecastOutcome], ...] = ([], [])
    for k in range(110):
        now = state(k / 10, 12.0 - min(0.4 * k, 12.0))
        for forecasts, told, when in ((late, found[0], answered), (at_once, found[1], 0)):
            told += forecasts.take_state(now, START_NS)
            assert k or forecasts.forecast(7, INTENT, now, (), FRAME) is not None
            if k == when:
                forecasts.take_round(round_done(straight(), round_id=7))

    assert found[0] == found[1]
    assert found[0][0].travelled_m == pytest.approx(10.0)


def test_of_a_round_that_completes_too_late_to_know_nothing_is_told() -> None:
    """Nobody remembers where the car was 29 s and more ago."""
    forecasts = fresh()
    found: list[ForecastOutcome] = []
    for k in range(350):
        now = state(k / 10)
        found += forecasts.take_state(now, START_NS)
        if k == 0:
            forecasts.forecast(7, INTENT, now, (), FRAME)
        if k == 338:
            forecasts.take_round(round_done(straight(), round_id=7))

    assert [one.horizon_s for one in found] == [4.0, 5.0, 6.0, 7.0, 8.0]
    assert [one.travelled_m for one in found] == pytest.approx([40.0, 50.0, 60.0, 70.0, 80.0])
