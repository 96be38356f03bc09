"""How far sweeps and rounds scale: `python -m tests.scale measure | predict | write`.

`measure` takes some ten minutes and writes `measured.json` beside this file, `predict` prints what
the model says of it, and `write` puts the tables and pictures into docs/scale.md.
"""

from __future__ import annotations

import sys
from pathlib import Path

import msgspec

from tests.scale.measured import Measured, measure
from tests.scale.plots import PICTURE, draw
from tests.scale.tables import DOC, held_out, written_into

MEASURED = Path(__file__).with_name("measured.json")


def main(arguments: list[str]) -> int:
    """Do what is asked for."""
    if arguments == ["measure"]:
        MEASURED.write_bytes(msgspec.json.encode(measure()) + b"\n")
        print(f"written: {MEASURED}")
        return 0
    if arguments == ["predict"]:
        print(held_out(kept()))
        return 0
    if arguments == ["write"]:
        page = written_into(DOC.read_text(encoding="utf-8"), kept())
        DOC.write_text(page, encoding="utf-8")
        draw(kept())
        print(f"written: {DOC} and {PICTURE}")
        return 0
    print(__doc__)
    return 2


def kept() -> Measured:
    """Return what was measured last."""
    return msgspec.json.decode(MEASURED.read_bytes(), type=Measured)


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
