"""Errors as one line."""

from __future__ import annotations

from foretwin.contracts.errors import UserError, one_line


def test_an_error_of_several_lines_becomes_one() -> None:
    assert one_line(UserError("drive.csv:\n  no column\t'lat'")) == (
        "UserError: drive.csv: no column 'lat'"
    )


def test_what_the_user_can_mend_is_a_value_error() -> None:
    assert issubclass(UserError, ValueError)
