"""Reports without places: no name, no position, no id of the map stands in them."""

from __future__ import annotations

import re
from pathlib import Path

import pytest

from foretwin.orchestrator.report.drawing import Canvas
from foretwin.orchestrator.report.page import html_of
from foretwin.orchestrator.report.redaction import PlaceNames, Redaction
from foretwin.orchestrator.report.write_report import report_of_folders
from tests.orchestrator.report.told_runs import street_crossing, told_run

TELLING = re.compile(
    r"Kronen|Markgrafen|Berlin|berlin|Gendarmenmarkt|5e87|\b[wn]\d{4,}|\d{1,3}\.\d{6,}"
)


@pytest.mark.parametrize("redaction", ["coarse", "places"])
def test_nothing_in_a_redacted_report_tells_the_place(redaction: Redaction, tmp_path: Path) -> None:
    run = told_run(tmp_path / "Berlin")
    words = _words(html_of(report_of_folders([run], redaction=redaction)))

    assert TELLING.findall(words) == []
    assert "street A \u00d7 street B" in words
    assert "foretwin repeat RUN " in words
    assert TELLING.search(_words(html_of(report_of_folders([run]))))


def test_pictures_of_the_place_stay_in_a_coarse_report_alone(tmp_path: Path) -> None:
    run = told_run(tmp_path)

    assert "<svg" in html_of(report_of_folders([run], redaction="coarse"))
    assert "<svg" not in _words(html_of(report_of_folders([run], redaction="places")))


def test_a_name_has_the_same_letter_everywhere_and_ids_are_left_out() -> None:
    names = PlaceNames({"Ring", "Am Ring", "Bahnhofstraße"})

    assert (
        names.without("Am Ring \u00d7 Ring, not a String")
        == "street A \u00d7 street B, not a String"
    )
    assert names.without("Bahnhofstraße (way 840229273) at 52.511451, 13.3936078") == (
        "street C (way …) at …, …"
    )
    assert names.without("lane w23755731.25663407.f0 with 12.5 m") == "lane … with 12.5 m"
    assert PlaceNames(()).without("Ring") == "Ring"
    assert PlaceNames({"Q7"}).without("Q7, not Q72") == "street A, not Q72"


def test_a_name_is_left_out_as_pictures_write_it() -> None:
    names = PlaceNames({"King's Road", "Marks & Spencer Way"})
    picture = Canvas(0.0, 0.0, 9.0, 9.0).svg("King's Road \u00d7 Marks & Spencer Way", "#fff")

    assert names.without("King's Road") == "street A"
    assert 'aria-label="street A \u00d7 street B"' in names.without(picture)


def test_the_crossing_of_these_tests_has_names_to_be_left_out() -> None:
    assert "Kronen" in street_crossing().intersection.name


def _words(page: str) -> str:
    """Return a page without the library of the plots and what these plot."""
    return re.sub(r"<script.*?</script>", "", page, flags=re.S)
