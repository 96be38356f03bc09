from __future__ import annotations

from pathlib import Path

import pytest

from foretwin.contracts.errors import UserError
from foretwin.orchestrator.lake.manifest import (
    MANIFEST,
    LakeFile,
    LakeManifest,
    Partition,
    part_name,
    read_manifest,
    write_manifest,
)
from foretwin.orchestrator.lake.store import FolderStore


def test_what_is_written_is_read_and_does_not_hang_on_the_order(tmp_path: Path) -> None:
    store, file = FolderStore(tmp_path), LakeFile("ab", 3, 1)
    write_manifest(store, LakeManifest(files={"t/b": file, "t/a": file}))
    before = (tmp_path / MANIFEST).read_bytes()

    write_manifest(store, LakeManifest(files={"t/a": file, "t/b": file}))

    assert (tmp_path / MANIFEST).read_bytes() == before
    assert read_manifest(store).files == {"t/a": file, "t/b": file}


def test_a_place_without_a_manifest_is_an_empty_lake(tmp_path: Path) -> None:
    assert read_manifest(FolderStore(tmp_path)) == LakeManifest()


@pytest.mark.parametrize(
    ("text", "told"),
    [
        ('{"lake_format": 2, "runs": 7}', r"format 2; this one reads 1"),
        ("[]", "is no manifest of a lake"),
        ('{"lake_format": 1, "runs": 7}', "is no manifest of a lake"),
    ],
)
def test_a_manifest_of_another_kind_is_told(tmp_path: Path, text: str, told: str) -> None:
    (tmp_path / MANIFEST).write_text(text)

    with pytest.raises(UserError, match=told):
        read_manifest(FolderStore(tmp_path))


def test_a_partition_is_a_path_whatever_its_vehicle_is_called() -> None:
    odd = Partition(day="2026-11-23", vehicle="../a=b c", map="osm-5e87")

    assert odd.path == "run_day=2026-11-23/run_vehicle=..%2Fa%3Db%20c/run_map=osm-5e87"


def test_parts_are_those_of_one_table_and_partition_in_order() -> None:
    names = [part_name(folder, n) for folder in ("t/x", "t/xy") for n in (1, 0)]
    manifest = LakeManifest(files=dict.fromkeys(names, LakeFile("", 0, 0)))

    assert manifest.parts("t/x") == ["t/x/part-00000.parquet", "t/x/part-00001.parquet"]
