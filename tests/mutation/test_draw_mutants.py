"""What is drawn and what is left out, since changing it changes no result."""

from __future__ import annotations

import json
import subprocess
from pathlib import Path

import pytest

from tests.mutation.__main__ import _tool
from tests.test_layout import ROOT

LEFT_OUT = """
from __future__ import annotations
import functools
from typing import Protocol
class Asked(Protocol):
    def count(self) -> int: return 7
@functools.lru_cache(maxsize=8)
def kept(one: int | None, frozen: bool) -> float | None: ...
class Said(Struct, frozen=True, kw_only=True): ...
for a, b in zip(one, other, strict=True): ...
@traced("a round")
def traced_one(): ...
"""
DRAWN = """
WITHIN_M = 120.0
class Said(Struct, forbid_unknown_fields=True): ...
if a < b: pass
zip(one, other[1:])
opened(strict=True)
_LEAST_S, _MOST_S = 1.0, 7.0
"""


@pytest.mark.judge
def test_what_changes_no_result_is_left_out_and_all_else_is_drawn(tmp_path: Path) -> None:
    def drawn(text: str) -> set[tuple[int, str]]:
        (tmp_path / "one.py").write_text(text, encoding="utf-8")
        asked = {"root": str(tmp_path), "files": ["one.py"], "seed": 1, "count": 1000}
        told = subprocess.run(
            [_tool(), ROOT / "tests" / "mutation" / "draw_mutants.py"],
            input=json.dumps(asked), capture_output=True, text=True, check=True,
        ).stdout  # fmt: skip
        return {(one["line"], one["operator"]) for one in json.loads(told)["mutants"]}

    # The loop itself may be gone; its `zip` may not be told that lengths are equal.
    assert drawn(LEFT_OUT) == {(10, "core/ZeroIterationForLoop")}
    places = {line for line, _ in drawn(DRAWN)}
    assert places == {2, 3, 4, 5, 6, 7}
    trebled = {line for line, operator in drawn(DRAWN) if operator == "trebled"}
    assert trebled == {2, 7}
    assert (7, "core/NumberReplacer") not in drawn(DRAWN)
