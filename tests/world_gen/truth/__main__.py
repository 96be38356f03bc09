"""`python -m tests.world_gen.truth [FILE]` prints the table, and writes it to FILE.

It reads HD maps and tracks from the folder named by FORETWIN_DATA, and runs netconvert of the
environment named by JUDGES_VENV.
"""

from __future__ import annotations

import sys
import tempfile
from pathlib import Path

from tests.world_gen.data_maps import data_folder
from tests.world_gen.truth.table import as_text, rows


def main(arguments: list[str]) -> None:
    """Measure, print and write."""
    data = data_folder()
    with tempfile.TemporaryDirectory(prefix="foretwin-truth-") as folder:
        text = as_text(list(rows(data, Path(folder))))
    print(text)
    for file in arguments:
        Path(file).write_text(f"{text}\n", encoding="utf-8")


if __name__ == "__main__":
    main(sys.argv[1:])
