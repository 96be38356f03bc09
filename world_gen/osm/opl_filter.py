"""Decode a map to OPL: from memory, or as a process from standard input to standard output.

For large maps a process of its own, since osmium keeps Python waiting while it decodes, and since
the process bounds what it holds by how fast its output is taken. It imports nothing of this
package: run by its path.
"""

from __future__ import annotations

import ctypes
import json
import os
import sys
from typing import Any

import osmium


def decode(source: Any, target: Any) -> dict[str, Any]:
    """Write osmium's `source` as OPL to its `target`; return the header's generator and bounds."""
    with osmium.io.Reader(source) as reader:
        header = reader.header()
        box = header.box()
        bounds = None
        if box.valid():
            low, high = box.bottom_left, box.top_right
            bounds = [low.lat, low.lon, high.lat, high.lon]
        writer = osmium.SimpleWriter(target)
        try:
            osmium.apply(reader, writer)
        finally:
            _close(writer)
    return {"generator": header.get("generator"), "bounds": bounds}


def _close(writer: Any) -> None:
    """Close a writer; one that has failed, on text that is no UTF-8, must never be destroyed.

    Its destructor would try once more, fail, and with it end the whole process.
    """
    try:
        writer.close()
    except BaseException:
        ctypes.pythonapi.Py_IncRef(ctypes.py_object(writer))
        raise


def main(form: str, options: str) -> None:
    """Decode; standard error gets the header as JSON, or a fault as plain text."""
    try:
        header = decode(osmium.io.File("-", form), osmium.io.File("-", options))
        os.write(2, json.dumps(header).encode())
    except Exception as error:
        os.write(2, " ".join(str(error).split()).encode(errors="replace"))
        os._exit(3)  # a writer that has failed ends the process by itself when it is destroyed


if __name__ == "__main__":
    main(sys.argv[1], sys.argv[2])
