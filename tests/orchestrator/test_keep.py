"""How much of a run is kept, from what the user says."""

from __future__ import annotations

import math

import pytest

from foretwin.contracts.errors import UserError
from foretwin.contracts.segments import Roll
from foretwin.orchestrator.keep import Keep, parse_keep


def test_hours_or_a_size() -> None:
    assert parse_keep(None) == Keep()
    assert not parse_keep(None).bounded
    assert parse_keep("12h") == Keep(hours=12.0)
    assert parse_keep("0.5h").hours == 0.5
    assert parse_keep("20GB") == parse_keep("20000 MB") == Keep(total_bytes=20e9)


@pytest.mark.parametrize("text", ["", "12", "12 days", "-1h", "h", "20gb", "1h 2GB", "nanh"])
def test_anything_else_says_what_would_be_right(text: str) -> None:
    with pytest.raises(UserError, match="hours or a size, such as 12h, 500MB or 20GB"):
        parse_keep(text)


@pytest.mark.parametrize("text", ["0h", "0.01h", "0GB", "10MB"])
def test_what_is_too_little_to_be_kept_is_refused(text: str) -> None:
    with pytest.raises(UserError, match=r"at least 0\.1h or 50MB"):
        parse_keep(text)


def test_parts_are_as_small_as_what_is_kept_needs() -> None:
    assert parse_keep(None).recordings == Roll()
    assert parse_keep(None).tables == Roll(most_bytes=4 * Roll().most_bytes, most_s=math.inf)
    assert parse_keep(None).view.most_bytes < Roll().most_bytes
    small = parse_keep("100MB")
    assert small.view == small.recordings
    assert small.recordings.most_bytes < 100e6 / 16
    assert small.tables == small.recordings
    assert parse_keep("1h").recordings.most_s == 450.0
    assert parse_keep("1000h").recordings == Roll()
