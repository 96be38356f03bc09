"""One mark stands for each run of letters that cannot be shown."""

from __future__ import annotations

from foretwin.contracts.left_out import without


def test_each_run_of_letters_has_one_mark() -> None:
    assert without("国道304号線", "国道号線") == "…304…"
    assert without("中山 路 East", "中山路") == "… East"
    assert without("中\n山", "中山") == "…\n…", "lines stay"
    assert without("a-b]c^", "^]-") == "a…b…c…"
    assert without("East", ()) == "East"
