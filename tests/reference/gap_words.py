"""What the columns of gaps and verdicts say; the other tables are in `table_words`."""

from __future__ import annotations

from collections.abc import Mapping

COLUMNS: Mapping[str, Mapping[str, str]] = {
    "gaps": {
        "horizon_s": "how long the model ran freely",
        "manoeuvre": "what the car did",
        "along_m": "along the real heading, positive ahead",
        "across_m": "across it, positive left",
        "yaw_rad": "in yaw",
        "yaw_rate_radps": "in yaw rate",
        "speed_mps": "in speed",
        "accel_mps2": "in acceleration",
        "along_std_m": "standard deviation that uncertain states leave open of `along_m`",
        "across_std_m": "the same of `across_m`",
        "yaw_std_rad": "the same of `yaw_rad`",
        "speed_std_mps": "the same of `speed_mps`",
    },
    "verdicts": {
        "since_stamp_ns": "since when",
        "culprit": "model, vehicle, both, none or undecided",
        "cause": "a key such as steering_gain; empty where none is known",
        "text": "the verdict in a sentence",
        "evidence": "what speaks for it",
        "confidence": "how sure the culprit is, 0 to 1",
    },
}
