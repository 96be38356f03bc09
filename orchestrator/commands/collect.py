"""The command `collect`: many runs and sweeps into one lake."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import pyarrow as pa

from foretwin.contracts.errors import UserError
from foretwin.contracts.terminal import say
from foretwin.orchestrator.commands.progress_bar import progress_bar
from foretwin.orchestrator.commands.told import CommandResult
from foretwin.orchestrator.lake.collect import collect, damaged
from foretwin.orchestrator.lake.manifest import MANIFEST, read_manifest
from foretwin.orchestrator.lake.store import FolderStore, LakeStore, store_at
from foretwin.orchestrator.record.folders_of_runs import folders_of_runs

NONE_USABLE, SOME_REFUSED = 2, 3


def collect_runs(given: Sequence[Path], *, into: str, replace: bool, verify: bool) -> CommandResult:
    """Collect runs into a lake; its code is 0, 2 where no run can be used, or 3 where some are
    refused or files of the lake are damaged.

    Raises UserError in one line where nothing can be collected.
    """
    folders = [folder for one in given for folder in folders_of_runs(one)]
    if not folders and not verify:
        raise UserError("name folders of runs or sweeps, or of several of them")
    store = store_at(into)
    try:
        if not folders and store.read(MANIFEST) is None:
            raise UserError(f"--into {into}: no lake is there")
        return _collect(store, folders, replace=replace, verify=verify)
    except (OSError, pa.ArrowException) as error:
        if isinstance(store, FolderStore):
            raise
        raise UserError(f"--into {into}: {' '.join(str(error).split())}") from error


def _collect(
    store: LakeStore, folders: Sequence[Path], *, replace: bool, verify: bool
) -> CommandResult:
    with progress_bar(len(folders), "runs") as (advance, tell):
        done = collect(store, folders, replace=replace, advance=advance)
        for line in done.refused:
            tell(f"refused: {line}")
    wrong = damaged(store) if verify else []
    files = len(read_manifest(store).files) if verify else None
    for line in wrong:
        say(f"damaged: {line}", error=True)
    counts = len(done.added), len(done.replaced), len(done.there), len(done.refused)
    words = ("collected", "replaced", "were there", "refused")
    told = ", ".join(f"{count} {word}" for count, word in zip(counts, words, strict=True) if count)
    code = SOME_REFUSED if done.refused or wrong else 0
    if done.refused and not (done.added or done.replaced or done.there):
        code = NONE_USABLE
    said = [f"{told}; {done.rows} rows added"] if folders else []
    if files is not None:
        said.append(f"{files - len(wrong)} of {files} files hold, {len(wrong)} are damaged")
    return CommandResult(
        {"lake": store.where, "files_checked": files, "damaged": wrong, "collected": done},
        f"{store.where}: {'; '.join(said)}",
        code,
    )
