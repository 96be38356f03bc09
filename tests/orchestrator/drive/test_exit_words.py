"""The exit code says what run.json says."""

from __future__ import annotations

import pytest

from foretwin.orchestrator.drive.exit_words import VEHICLE_ENDED, exit_code


@pytest.mark.parametrize(
    ("word", "whole", "code"),
    [
        ("completed", True, 0), ("completed", False, 3), (VEHICLE_ENDED, False, 3),
        (VEHICLE_ENDED, True, 3), ("interrupted", True, 130), ("interrupted", False, 130),
        ("failed", False, 1),
    ],
)  # fmt: skip
def test_each_way_to_end_has_its_code(word: str, whole: bool, code: int) -> None:
    assert exit_code(word, whole=whole) == code
