"""The process that decodes a map: a map file on standard input, OPL on standard output.

A process of its own, since osmium keeps Python waiting while it decodes, and since it bounds what
it holds by how fast its output is taken. It knows nothing of this package: run by its path.
"""

from __future__ import annotations

import json
import os
import sys

import osmium


def main(form: str, options: str) -> None:
    """Decode; the header goes as one line of JSON to standard error, a fault as plain text."""
    try:
        with osmium.io.Reader(osmium.io.File("-", form)) as reader:
            header = reader.header()
            box = header.box()
            bounds = None
            if box.valid():
                low, high = box.bottom_left, box.top_right
                bounds = [low.lat, low.lon, high.lat, high.lon]
            said = {"generator": header.get("generator"), "bounds": bounds}
            os.write(2, json.dumps(said).encode() + b"\n")
            with osmium.SimpleWriter(osmium.io.File("-", options)) as writer:
                osmium.apply(reader, writer)
    except Exception as error:
        os.write(2, " ".join(str(error).split()).encode(errors="replace"))
        os._exit(3)  # a writer that has failed ends the process by itself when it is destroyed


if __name__ == "__main__":
    main(sys.argv[1], sys.argv[2])
