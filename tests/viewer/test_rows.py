"""Text of strangers in the viewer: what its fonts have, and a mark for what they lack."""

from __future__ import annotations

import unicodedata

from hypothesis import given
from hypothesis import strategies as st

from foretwin.viewer.rows import path_part, place_text, plain_text
from foretwin.world_gen.export.picture_fonts import Fonts


@given(st.text())
def test_labels_keep_to_glyphs_that_the_viewer_has(text: str) -> None:
    told = plain_text(text)
    signs = "–—‘’“”„•…→←↑↓≤≥≈−"  # noqa: RUF001
    scripts = ("GREEK", "CYRILLIC", "LATIN")
    assert all(
        ord(one) < 0x250 or one in signs or unicodedata.name(one).startswith(scripts)
        for one in told
    )
    assert plain_text(told) == told


def test_street_names_stay_readable() -> None:
    assert plain_text("Kronenstraße · Łódź · © Žižka") == "Kronenstraße · Łódź · © Žižka"
    for name in ("Οδός Ἀθηνᾶς", "Тверская улица", "вулиця Ґалаґана", "Đường Trần Phú", "Қонаев"):
        assert plain_text(name) == name
    assert plain_text("東京 🚗") == "…"


def test_what_the_viewer_cannot_show_has_one_mark_as_in_pictures() -> None:
    assert plain_text("国道304号線 / Main Street") == "…304… / Main Street"
    missing = frozenset("国道号線")
    assert Fonts(missing=missing).drawable("国道304号線 / Main Street") == (
        plain_text("国道304号線 / Main Street")
    )
    assert place_text("国道304号線", "n7") == "国道304号線 n7"
    assert (place_text("Main Street", "n7"), place_text("", "n7")) == ("Main Street", "n7")


def test_entities_of_any_name_stay_apart() -> None:
    assert len({path_part(name) for name in ("車", "東", "car", "東1")}) == 4
