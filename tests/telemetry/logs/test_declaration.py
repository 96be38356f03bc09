"""Every key and unit of a declaration is documented, with its default."""

from __future__ import annotations

import json
from pathlib import Path

import msgspec
import pytest

from foretwin.telemetry.logs.declaration import (
    UNITS,
    Column,
    ControlSection,
    Declaration,
    HeadingSection,
    ImuSection,
    PositionSection,
    Section,
    SpeedSection,
    SteeringSection,
    TimeSection,
)

DOCS = Path(__file__).parents[3] / "docs" / "logs.md"
SECTIONS = {
    "": Declaration, "time": TimeSection, "position": PositionSection, "speed": SpeedSection,
    "heading": HeadingSection, "imu": ImuSection, "steering": SteeringSection,
    "control": ControlSection, "any section": Section, "column": Column,
}  # fmt: skip


@pytest.mark.parametrize("section", SECTIONS)
def test_the_documentation_has_every_key_with_its_default(section: str) -> None:
    told = {}
    called = {"": "top", "any section": section, "column": section}.get(section, f"`[{section}]`")
    for line in DOCS.read_text(encoding="utf-8").splitlines():
        cells = [cell.strip() for cell in line.strip("|").split("|")]
        if len(cells) == 4 and cells[0] == called:
            told[cells[1].strip("`")] = cells[2].strip("`")
    shared = () if section == "any section" else ("new_when", "again_s", "late_s")
    fields = {
        field.name: field
        for field in msgspec.structs.fields(SECTIONS[section])
        if field.name not in shared and field.name not in (SECTIONS if not section else ())
    }
    assert told.keys() == fields.keys()
    for name, field in fields.items():
        if field.required:
            assert told[name] == "needed", name
        elif field.default not in (None, ()):
            assert told[name] == json.dumps(field.default), name
        else:
            assert told[name] == "none", name


def test_the_documentation_has_every_unit() -> None:
    text = DOCS.read_text(encoding="utf-8")
    for kind in UNITS.values():
        assert ", ".join(f"`{unit}`" for unit in kind) in text
