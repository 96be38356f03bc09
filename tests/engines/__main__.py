"""`python -m tests.engines [DATA_FOLDER] [--parts junctions,reality]`: engines side by side.

`junctions` plays the same job, one car that drives freely, on every engine at 20 junctions of real
maps; where two end more than 0.5 m apart after 4 s, terms in which they differ are switched one by
one. `reality` lets engines go on from what real cars measured, and says what the mean of two is
worth beside MuJoCo alone.
"""

from __future__ import annotations

import argparse
import os
import sys
from collections.abc import Sequence
from pathlib import Path

from tests.engines.junctions import junctions_text
from tests.engines.reality import reality_text

PARTS = {"junctions": junctions_text, "reality": reality_text}


def main(arguments: Sequence[str]) -> int:
    """Print the tables; 2 for a wrong request."""
    parser = argparse.ArgumentParser(prog="python -m tests.engines", description=__doc__)
    parser.add_argument("data", nargs="?", default=os.environ.get("FORETWIN_DATA"))
    parser.add_argument("--parts", default=",".join(PARTS))
    asked = parser.parse_args(arguments)
    names = asked.parts.split(",")
    if asked.data is None or not set(names) <= PARTS.keys():
        print(f"DATA_FOLDER or FORETWIN_DATA; --parts of {', '.join(PARTS)}", file=sys.stderr)
        return 2
    for name in names:
        for line in PARTS[name](Path(asked.data)):
            print(line, flush=True)
    return 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
