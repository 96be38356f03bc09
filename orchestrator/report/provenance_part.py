"""Where a report's figures come from: files with their hashes, versions, settings, the map."""

from __future__ import annotations

import hashlib
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from foretwin.contracts.versions import versions
from foretwin.orchestrator.report.blocks import Chapter, Facts, Listed, TableCell, number, row

_HASHED_BYTES = 512 * 2**20
"""Files of a folder are hashed up to so many bytes together: more would take minutes."""
_FILES = (
    "run.json",
    "sweep.json",
    "manifest.jsonl",
    "drive*.mcap",
    "monitor*.rrd",
    "results/*.parquet",
    "metrics.parquet",
    "worlds/*.world",
    "vehicles/*.vehicle",
)
_MOST_FILES = 400


def provenance_part(folder: Path, record: Mapping[str, Any], *, places: bool = True) -> Chapter:
    """Return what a run or sweep was made with and of, file by file.

    Without `places` the map and the log are not named, and neither they nor Worlds are hashed.
    """
    told = record.get("map") or {}
    config = record.get("config") or record.get("spec") or {}
    pairs = [
        ("run", str(record.get("run_id") or folder.name)),
        (
            "ended",
            str(record.get("exit") or ("complete" if record.get("complete") else "not told")),
        ),
        ("seed", str(record.get("seed", config.get("seed", "not told")))),
    ]
    if places:
        pairs += [
            ("map", Path(str(told.get("file") or config.get("map") or "not told")).name),
            ("map, sha256", str(told.get("sha256") or "not told")),
        ]
    pairs += [
        (
            "futures, sha256",
            str(
                (record.get("futures") or {}).get("sha256")
                or record.get("rows_sha256")
                or "not told"
            ),
        ),
        ("made with", _versions(record.get("versions") or {})),
        ("report by", f"foretwin {versions()['foretwin']}"),
    ]
    return Chapter(
        "provenance",
        "Provenance",
        (Facts(tuple(pairs)), _settings(config, places=places), _files(folder, places=places)),
    )


def _versions(known: Mapping[str, str]) -> str:
    return ", ".join(f"{name} {version}" for name, version in known.items()) or "not told"


_TELL_PLACES = {
    "map",
    "dem",
    "tracks",
    "route",
    "log",
    "out",
    "cache_dir",
    "worlds",
    "bbox",
    "junctions",
    "recorded",
    "standin_dem",
    "progress_table",
    "config",
    "secure",
}


def _settings(config: Mapping[str, Any], *, places: bool) -> Listed:
    rows = tuple(
        row(name, TableCell(_short(name, value), code=True))
        for name, value in config.items()
        if value not in (None, False, [], {})
        and (places or not (name in _TELL_PLACES or _names_a_file(value)))
    )
    return Listed("Settings that were not left out", ("setting", "value"), rows, folded=True)


def _names_a_file(value: Any) -> bool:
    """Whether a setting is, or holds anywhere, what may be the name of a file or an address."""
    if isinstance(value, Mapping):
        return any(map(_names_a_file, value.values()))
    if isinstance(value, list | tuple):
        return any(map(_names_a_file, value))
    return isinstance(value, str) and any(sign in value for sign in "./\\")


def _short(name: str, value: Any) -> str:
    """Return a value; of paths the name alone: where files lay is no evidence."""
    if isinstance(value, str) and "/" in value and name != "endpoint":
        return Path(value).name
    return str(value)


def _files(folder: Path, *, places: bool) -> Listed:
    found = [path for pattern in _FILES for path in sorted(folder.glob(pattern))]
    if not places:
        found = [path for path in found if path.parent.name != "worlds"]
    rows, hashed = [], 0
    for path in found[:_MOST_FILES]:
        size = path.stat().st_size
        small = hashed + size <= _HASHED_BYTES
        if small:
            hashed += size
        digest = _sha256(path) if small else "not hashed: too large for a report"
        rows.append(
            row(
                str(path.relative_to(folder)),
                number(size / 1000.0, 1, "kB"),
                TableCell(digest, code=small),
            )
        )
    left = f"{len(found) - _MOST_FILES} more files." if len(found) > _MOST_FILES else ""
    return Listed(
        "Files of the folder",
        ("file", "size", "sha256"),
        tuple(rows),
        frozenset({1}),
        note=left,
        folded=True,
    )


def _sha256(path: Path) -> str:
    with path.open("rb") as file:
        return hashlib.file_digest(file, "sha256").hexdigest()
