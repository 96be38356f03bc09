"""Packages with planners, as if installed: modules and entry points in a folder."""

from __future__ import annotations

from pathlib import Path


def install(folder: Path, module: str, code: str, **entries: str) -> None:
    """Write `module` and say that its classes are planners, by name."""
    (folder / f"{module}.py").write_text(code)
    points = "".join(f"{name} = {module}:{kind}\n" for name, kind in entries.items())
    info = folder / f"{module}-1.0.dist-info"
    info.mkdir()
    (info / "METADATA").write_text(f"Metadata-Version: 2.1\nName: {module}\nVersion: 1.0\n")
    (info / "entry_points.txt").write_text(f"[foretwin.planners]\n{points}")
