"""A declaration that was written is read as what it was."""

from __future__ import annotations

import msgspec
from hypothesis import given
from hypothesis import strategies as st

from foretwin.telemetry.logs.declaration import (
    Column,
    Declaration,
    HeadingSection,
    PositionSection,
    TimeSection,
)
from foretwin.telemetry.logs.write_declaration import declaration_toml

texts = st.text(st.characters(codec="utf-8"), max_size=12)
columns = st.builds(Column, column=texts, unit=st.just("rad"), negate=st.booleans())
declarations = st.builds(
    Declaration,
    time=st.builds(TimeSection, column=texts, base=st.just("utc"), unit=st.just("s")),
    position=st.builds(
        PositionSection,
        frame=st.just("wgs84"),
        latitude=columns,
        longitude=columns,
        new_when=st.lists(texts, max_size=2).map(tuple),
        late_s=st.floats(-5.0, 5.0),
    ),
    reference_point=texts,
    body_from_antenna_m=st.none() | st.tuples(*[st.floats(-9.0, 9.0)] * 3),
    heading=st.none()
    | st.builds(HeadingSection, yaw=columns, zero=st.just("east"), direction=st.just("clockwise")),
)


@given(declarations, st.lists(texts, max_size=3))
def test_what_was_written_is_read(declaration: Declaration, lines: list[str]) -> None:
    text = declaration_toml(declaration, said={"time": lines, "heading": lines})
    assert msgspec.toml.decode(text, type=Declaration) == declaration


def test_a_name_in_a_comment_stays_on_its_line() -> None:
    declaration = Declaration(
        time=TimeSection(column="t", base="utc", unit="s"),
        position=PositionSection(frame="wgs84"),
        reference_point="here",
    )
    text = declaration_toml(declaration, said={"time": ["a\n[speed]\nforward = 1"]})
    assert msgspec.toml.decode(text, type=Declaration) == declaration
    assert "\n[speed]" not in text
