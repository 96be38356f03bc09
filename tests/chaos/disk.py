"""A disk of its own for a drive: small, full when it is told to be, or with folders that take no
new file."""

from __future__ import annotations

import contextlib
import os
import subprocess
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

SIZE_MB = 512
_FILL = "what-fills-the-disk"


class SmallDisk:
    """A folder that is a disk where that can be had (`limited`), else a folder like others."""

    def __init__(self, folder: Path, *, limited: bool) -> None:
        self.folder, self.limited = folder, limited
        self._closed: list[Path] = []

    def fill(self) -> bool:
        """Leave no byte; returns whether that can be done here."""
        if not self.limited:
            return False
        with (self.folder / _FILL).open("wb") as file:
            for size in (2**20, 4096):
                with contextlib.suppress(OSError):
                    while True:
                        os.posix_fallocate(file.fileno(), file.seek(0, os.SEEK_END), size)
                        file.seek(0, os.SEEK_END)
        return True

    def free(self) -> None:
        """Give the room back."""
        (self.folder / _FILL).unlink(missing_ok=True)

    def close_folders(self, *folders: Path) -> bool:
        """Let folders take no new file and lose none; returns whether that can be done here."""
        for folder in folders:
            if subprocess.run(
                ["chattr", "+i", folder], capture_output=True, check=False
            ).returncode:
                self.open_folders()
                return False
            self._closed.append(folder)
        return True

    def open_folders(self) -> None:
        """Let all folders take files again."""
        for folder in self._closed:
            subprocess.run(["chattr", "-i", folder], capture_output=True, check=False)
        self._closed.clear()


@contextmanager
def small_disk(folder: Path) -> Iterator[SmallDisk]:
    """Make `folder` a disk of its own in memory, where this user may."""
    folder.mkdir()
    mount = ["mount", "-t", "tmpfs", "-o", f"size={SIZE_MB}m", "tmpfs", str(folder)]
    limited = not subprocess.run(mount, capture_output=True, check=False).returncode
    disk = SmallDisk(folder, limited=limited)
    try:
        yield disk
    finally:
        disk.open_folders()
        if limited:
            subprocess.run(["umount", "--lazy", folder], check=True)
