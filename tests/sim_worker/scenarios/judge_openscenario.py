"""Run by the judges' interpreter: what ASAM's checker finds in OpenSCENARIO files.

Reads a JSON list of files, writes one object for each: `issues` found, `checks` completed, and
`failed`, the checks that broke off. The checker ends with 0 whatever it finds.
"""

from __future__ import annotations

import collections
import json
import logging
import sys
import tempfile
from pathlib import Path
from typing import Any

from lxml import etree
from qc_baselib import Configuration, Result
from qc_openscenario import constants
from qc_openscenario.main import run_checks


def judged(file: str) -> dict[str, Any]:
    config = Configuration()
    config.set_config_param("InputFile", file)
    result = Result()
    result.register_checker_bundle(
        name=constants.BUNDLE_NAME, description="", version=constants.BUNDLE_VERSION, summary=""
    )
    result.set_result_version(version=constants.BUNDLE_VERSION)
    run_checks(config, result)
    with tempfile.TemporaryDirectory() as folder:
        report = Path(folder) / "result.xqar"
        result.write_to_file(str(report))
        root = etree.parse(report).getroot()
    statuses = collections.Counter(c.get("status") for c in root.iter("Checker"))
    return {
        "issues": [issue.get("description", "") for issue in root.iter("Issue")],
        "checks": statuses["completed"],
        "failed": statuses["error"],
    }


logging.disable(logging.CRITICAL)
json.dump([judged(file) for file in json.load(sys.stdin)], sys.stdout)
