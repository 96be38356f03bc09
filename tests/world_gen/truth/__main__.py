"""`python -m tests.world_gen.truth [FILE]` prints the table, and writes it to FILE.

It reads HD maps and tracks from the folder named by FORETWIN_DATA, and runs netconvert of the
environment named by JUDGES_VENV.
"""

from __future__ import annotations

import os
import sys
import tempfile
from pathlib import Path

from tests.world_gen.truth.table import as_text, rows


def main(arguments: list[str]) -> int:
    """Measure, print and write; exit code 2 where the data are not named."""
    data = os.environ.get("FORETWIN_DATA")
    if not data:
        print("FORETWIN_DATA names no folder with HD maps and tracks", file=sys.stderr)
        return 2
    with tempfile.TemporaryDirectory(prefix="foretwin-truth-") as folder:
        text = as_text(list(rows(Path(data), Path(folder))))
    print(text)
    for file in arguments:
        Path(file).write_text(f"{text}\n", encoding="utf-8")
    return 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
