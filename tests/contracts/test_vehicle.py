"""A vehicle's parameters, and what others take it for."""

from __future__ import annotations

import pytest

from foretwin.contracts.vehicle import Parameter, kind_by_length


@pytest.mark.parametrize(
    ("length_m", "kind"),
    [(3.6, "car"), (5.2, "car"), (5.3, "van"), (6.9, "van"), (7.0, "lorry"), (12.0, "lorry")],
)
def test_what_a_vehicle_is_taken_for_by_its_length(length_m: float, kind: str) -> None:
    assert kind_by_length(length_m) == kind


def test_a_number_without_a_word_is_a_default_of_unknown_spread() -> None:
    assert Parameter(1.5) == Parameter(1.5, None, "default")
