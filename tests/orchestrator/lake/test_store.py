from __future__ import annotations

import os
import time
from pathlib import Path

import pyarrow.fs as pafs
import pytest

from foretwin.contracts.errors import UserError
from foretwin.orchestrator.lake.store import CLAIM_S, CLAIMS, FolderStore, ObjectStore, store_at


def objects(folder: Path) -> ObjectStore:
    """A store that is a folder and is held by claims, as one on the net is."""
    (folder / CLAIMS).mkdir(parents=True, exist_ok=True)
    return ObjectStore("s3://bucket", pafs.SubTreeFileSystem(str(folder), pafs.LocalFileSystem()))


def test_what_is_staged_is_seen_by_its_name_once_it_is_published(tmp_path: Path) -> None:
    store = FolderStore(tmp_path)
    with store.staging("table/a.parquet") as sink:
        sink.write(b"rows")

    assert store.staged() == ["table/a.parquet"]
    assert store.read("table/a.parquet") is None
    assert store.sha256("table/a.parquet", staged=True) == sink.sha256
    store.publish("table/a.parquet")
    assert (store.read("table/a.parquet"), store.staged()) == (b"rows", [])


def test_one_collect_at_a_time_writes_into_a_folder(tmp_path: Path) -> None:
    with (
        FolderStore(tmp_path).held(),
        pytest.raises(UserError, match=f"--into {tmp_path}: another collect.*{os.getpid()}"),
        FolderStore(tmp_path).held(),
    ):
        pass
    with FolderStore(tmp_path).held():  # it is free again
        pass


def test_who_finds_another_in_an_object_store_gives_way(tmp_path: Path) -> None:
    with objects(tmp_path).held():
        with (
            pytest.raises(UserError, match="another collect writes there"),
            objects(tmp_path).held(),
        ):
            pass
        assert len(list((tmp_path / CLAIMS).iterdir())) == 1
    assert list((tmp_path / CLAIMS).iterdir()) == []


def test_a_claim_that_nobody_renewed_is_dead(tmp_path: Path) -> None:
    objects(tmp_path)
    left = tmp_path / CLAIMS / "killed"
    left.touch()
    long_ago_s = time.time() - CLAIM_S - 60.0
    os.utime(left, (long_ago_s, long_ago_s))

    with objects(tmp_path).held():
        assert not left.exists()


def test_who_was_held_for_dead_does_not_go_on(tmp_path: Path) -> None:
    store = objects(tmp_path)
    with store.held():
        (claim,) = (tmp_path / CLAIMS).iterdir()
        store.renewed_s -= 3600.0
        store.renew()
        claim.unlink()
        store.renew()  # not so soon again
        store.renewed_s -= 3600.0
        with pytest.raises(UserError, match="another collect took over"):
            store.renew()


def test_where_no_lake_can_be_is_told_with_what_would_be_right() -> None:
    with pytest.raises(UserError, match="neither a folder nor s3://BUCKET/PREFIX"):
        store_at("ftp://somewhere/lake")


def test_a_file_address_is_a_folder(tmp_path: Path) -> None:
    assert isinstance(store_at(f"file://{tmp_path}"), FolderStore)


def test_a_folder_of_something_else_is_no_lake(tmp_path: Path) -> None:
    (tmp_path / "run.json").touch()

    with (
        pytest.raises(UserError, match="holds other files and no lake"),
        FolderStore(tmp_path).held(),
    ):
        pass
    with pytest.raises(UserError, match="is a file"), FolderStore(tmp_path / "run.json").held():
        pass
