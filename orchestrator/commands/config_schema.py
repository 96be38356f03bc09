"""JSON Schema of files that users write: what msgspec knows of their types, and what they mean."""

from __future__ import annotations

import math
from typing import Any

import msgspec

from foretwin.contracts.field_words import fields_of, tables_of
from foretwin.contracts.numbers import Range
from foretwin.orchestrator.commands.config_formats import HIDDEN, RANGES, FileKind
from foretwin.orchestrator.config import DriveConfig

_ALSO: dict[tuple[type, str], dict[str, Any]] = {(DriveConfig, "speed"): {"const": "max"}}
"""What a file may say that its type, which has been read, does not hold."""


def schema_of(kind: FileKind) -> dict[str, Any]:
    """Return the JSON Schema of a kind of file, with the words and ranges of its keys."""
    (top,), defined = msgspec.json.schema_components([kind.type], ref_template="#/$defs/{name}")
    for struct in tables_of(kind.type):
        properties = defined.get(struct.__name__, {}).get("properties", {})
        for field in fields_of(struct):
            if (struct, field.name) in HIDDEN:
                properties.pop(field.name, None)
                continue
            found = properties[field.name]
            if (struct, field.name) in RANGES:
                found = _bounded(found, RANGES[struct, field.name])
            if (struct, field.name) in _ALSO:
                found = {"anyOf": [found, _ALSO[struct, field.name]]}
            properties[field.name] = found | ({"description": field.text} if field.text else {})
    return {
        "$schema": "https://json-schema.org/draft/2020-12/schema",
        "title": f"foretwin: {kind.what}",
        **top,
        "$defs": defined,
    }


def _bounded(schema: dict[str, Any], allowed: Range) -> dict[str, Any]:
    """Return a schema whose numbers are within a range; of a parameter, its value."""
    if "$ref" in schema:
        return {"allOf": [schema, {"properties": {"value": _ends(allowed)}}]}
    if "anyOf" in schema:
        parts = [
            one | _ends(allowed) if one.get("type") in ("number", "integer") else one
            for one in schema["anyOf"]
        ]
        return schema | {"anyOf": parts}
    return schema | _ends(allowed)


def _ends(allowed: Range) -> dict[str, float]:
    ends = {"exclusiveMinimum" if allowed.above_low else "minimum": allowed.low}
    return ends if math.isinf(allowed.high) else ends | {"maximum": allowed.high}
