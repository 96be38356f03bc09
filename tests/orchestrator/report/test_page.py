"""The page of a report: what its tables are sorted by."""

from __future__ import annotations

import re

from foretwin.orchestrator.report.blocks import Chapter, Listed, Report, number, row
from foretwin.orchestrator.report.page import html_of


def test_numbers_are_sorted_by_all_of_their_digits() -> None:
    counts = (12_344.0, 12_341.0, 4321.75, 4321.5, 1.5e-06)
    table = Listed("Futures", ("count",), tuple(row(number(one)) for one in counts))

    page = html_of(Report("a", "b", "c", "good", (), (), (Chapter("one", "One", (table,)),), ()))

    assert [float(one) for one in re.findall(r'data-order="([^"]+)"', page)] == list(counts)
