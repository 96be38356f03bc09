"""A file of a user, read into a type: what is wrong with it is said in one line."""

from __future__ import annotations

from pathlib import Path

import msgspec
import pytest

from foretwin.contracts.errors import UserError
from foretwin.contracts.toml_file import read_toml


class Cake(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    layers: int


def check(cake: Cake) -> None:
    if cake.layers < 1:
        raise ValueError(f"layers is {cake.layers}; it must be 1 or more")


def read(path: Path) -> Cake:
    return read_toml(path, Cake, what="cake", check=check, words=str.upper)


def test_a_file_is_what_it_says(tmp_path: Path) -> None:
    (tmp_path / "a.toml").write_text("layers = 3", encoding="utf-8")
    assert read(tmp_path / "a.toml") == Cake(3)


@pytest.mark.parametrize(
    ("text", "said"),
    [
        (b"layers = 0", "layers is 0; it must be 1 or more"),
        (b"layers = ", "is no TOML: Invalid value"),
        (b"layers = 'x'", "EXPECTED `INT`, GOT `STR` - AT `$.LAYERS`"),
        (b"layers = '\xff'", "is no UTF-8 text"),
    ],
)
def test_what_is_wrong_is_said_with_the_file(text: bytes, said: str, tmp_path: Path) -> None:
    file = tmp_path / "a.toml"
    file.write_bytes(text)
    with pytest.raises(UserError) as caught:
        read(file)
    assert str(caught.value).startswith(f"cake file {file}")
    assert said in str(caught.value)


def test_a_missing_file_and_a_folder_are_no_files(tmp_path: Path) -> None:
    for path in (tmp_path, tmp_path / "none.toml"):
        with pytest.raises(FileNotFoundError, match="no cake file"):
            read(path)
