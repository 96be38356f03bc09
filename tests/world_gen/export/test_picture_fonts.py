"""Names in all scripts, in pictures without boxes."""

from __future__ import annotations

from pathlib import Path

import pytest

from foretwin.contracts.left_out import LEFT_OUT
from foretwin.world_gen.export.picture import write_picture
from foretwin.world_gen.export.picture_fonts import PLAIN, Fonts, fonts_for
from tests.world_gen.drawn_maps import STREET, crossing, world_of

LINEAR_B = "\U00010000\U00010001"
"""Letters that no font here is likely to have."""


@pytest.mark.parametrize("name", ["Kronenstraße", "Łódź", "Тверская улица", "Λεωφόρος", "שדרות"])
def test_dejavu_draws_what_it_has(name: str) -> None:
    fonts = fonts_for(name)
    assert not fonts.missing
    assert fonts.drawable(name) == name
    assert fonts.families(PLAIN)[0] in (PLAIN, "DejaVu Sans")


def test_what_no_font_has_is_left_out_once_for_a_run() -> None:
    fonts = Fonts(missing=frozenset("中山路"))
    assert fonts.drawable("中山 路 East: 3 lanes") == f"{LEFT_OUT} East: 3 lanes"
    assert Fonts().drawable("中山路") == "中山路"


def test_no_letter_counts_as_drawn_by_the_font_of_last_resort() -> None:
    fonts = fonts_for(f"{LINEAR_B} Road")
    assert not any(name.startswith("Last Resort") for name in fonts.more)
    assert fonts.more or fonts.missing == frozenset(LINEAR_B)


def test_a_picture_of_streets_in_any_script_has_no_boxes(tmp_path: Path) -> None:
    """matplotlib warns of each letter that it draws as a box, and warnings are errors here."""
    names = f"中山路 ถนน {LINEAR_B}"
    world = world_of(crossing(street={**STREET, "name": names}))
    assert names in world.intersection.name
    for suffix in ("png", "svg"):
        write_picture(world, tmp_path / f"any.{suffix}")
    text = (tmp_path / "any.svg").read_text(encoding="utf-8")
    assert world.intersection.id in text
    drawn = text.partition("</metadata>")[2]
    assert LINEAR_B not in drawn or fonts_for(LINEAR_B).more
