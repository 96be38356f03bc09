"""A file of a user, read into a type: what is wrong with it is said in one line."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import msgspec
import pytest

from foretwin.contracts.errors import UserError
from foretwin.contracts.toml_file import read_toml
from foretwin.orchestrator.config_file import load_config
from foretwin.orchestrator.worlds.overpass import load_overpass_config
from foretwin.telemetry.logs.declaration import read_declaration
from foretwin.telemetry.logs.map_origin import declared_of
from foretwin.telemetry.ros2.mapping import read_mapping
from foretwin.telemetry.standin.parameters import read_parameters


class Cake(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    layers: int


def check(cake: Cake) -> None:
    if cake.layers < 1:
        raise ValueError(f"layers is {cake.layers}; it must be 1 or more")


def read(path: Path) -> Cake:
    return read_toml(path, Cake, what="cake", check=check)


def test_a_file_is_what_it_says(tmp_path: Path) -> None:
    (tmp_path / "a.toml").write_text("layers = 3", encoding="utf-8")
    assert read(tmp_path / "a.toml") == Cake(3)


@pytest.mark.parametrize(
    ("text", "said"),
    [
        (b"\nlayers = 0", ": line 2: layers is 0; it must be 1 or more"),
        (b"\n\nlayers = ", ": line 3: not TOML: Invalid value"),
        (b"layers = [", ": line 1: not TOML: "),
        (b"layers = 'x'", ": line 1: layers 'x': must be a whole number"),
        (b"layers = 1\nlayer = 2", ": line 2: unknown key 'layer'; did you mean layers? one of"),
        (b"layer = 2", ": line 1: unknown key 'layer'; did you mean layers? one of layers"),
        (b"", ": the key 'layers' is missing"),
        (b"# cake\nlayers = '\xff'", "line 2 is no UTF-8 text (byte 0xff); save the file as UTF-8"),
    ],
)
def test_what_is_wrong_is_said_with_the_file(text: bytes, said: str, tmp_path: Path) -> None:
    file = tmp_path / "a.toml"
    file.write_bytes(text)
    with pytest.raises(UserError) as caught:
        read(file)
    assert str(caught.value).startswith(f"cake file {file}")
    assert said in str(caught.value)


def test_a_byte_order_mark_is_passed_over(tmp_path: Path) -> None:
    (tmp_path / "a.toml").write_bytes(b"\xef\xbb\xbflayers = 3")
    assert read(tmp_path / "a.toml") == Cake(3)


def test_a_missing_file_and_a_folder_are_told_apart(tmp_path: Path) -> None:
    with pytest.raises(FileNotFoundError, match="no cake file"):
        read(tmp_path / "none.toml")
    with pytest.raises(UserError, match=r"cake file .*: is a folder, not a file"):
        read(tmp_path)


READERS = (
    lambda path: load_config(path, {}),
    load_overpass_config,
    read_declaration,
    lambda path: declared_of(path.with_name("drive.mcap"), path),
    read_mapping,
    read_parameters,
)


@pytest.mark.parametrize("reader", READERS)
def test_every_reader_says_the_line_that_is_no_utf8(
    reader: Callable[[Path], object], tmp_path: Path
) -> None:
    file = tmp_path / "a.toml"
    file.write_bytes(b"# Stra\xdfe\n")
    with pytest.raises(UserError, match=r"a\.toml: line 1 is no UTF-8 text \(byte 0xdf\)"):
        reader(file)
    with pytest.raises(UserError, match="is a folder, not a file"):
        reader(tmp_path)
    with pytest.raises(FileNotFoundError, match=r"none\.toml: no such file"):
        reader(tmp_path / "none.toml")
