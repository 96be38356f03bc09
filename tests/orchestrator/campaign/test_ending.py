"""That a drive's certificates end is told a day before, ten minutes before, and when they have."""

from __future__ import annotations

import datetime

from foretwin.contracts.certificates import UTC
from foretwin.orchestrator.campaign.ending import CertificateEnd

ENDS = datetime.datetime(2026, 11, 30, 12, 0, tzinfo=UTC)


def before(**left: float) -> datetime.datetime:
    return ENDS - datetime.timedelta(**left)


def test_it_is_told_once_a_day_and_ten_minutes_before_and_at_the_end() -> None:
    end = CertificateEnd(ENDS)
    assert list(end.news(before(days=2))) == []
    (text,) = end.news(before(hours=23, minutes=59, seconds=30))
    assert text.startswith(
        "a certificate of this drive ends 2026-11-30 12:00 UTC, in 24 h 0 min: its links close then"
    )
    assert list(end.news(before(hours=1))) == []
    (text,) = end.news(before(minutes=9, seconds=30))
    assert "in 10 min" in text
    assert list(end.news(before(seconds=1))) == []
    (text,) = end.news(ENDS)
    assert "has ended" in text
    assert list(end.news(before(days=-1))) == []


def test_a_drive_that_begins_late_is_told_once() -> None:
    end = CertificateEnd(ENDS)
    (text,) = end.news(before(minutes=5))
    assert "in 5 min" in text
    assert list(end.news(before(minutes=4))) == []


def test_a_drive_without_certificates_is_told_nothing() -> None:
    assert list(CertificateEnd(None).news(ENDS)) == []
