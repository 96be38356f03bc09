"""What all views share, Rerun's and the co-pilot display's: the one table of colours."""

from __future__ import annotations

Colour = tuple[int, int, int]

SAFE: Colour = (56, 176, 92)
WATCH: Colour = (255, 184, 28)
CRITICAL: Colour = (234, 62, 56)
NOMINAL: Colour = (250, 250, 255)
"""Of the nominal future among those from safe to critical."""
ROAD_USER: Colour = (214, 112, 214)
DETECTED: Colour = (206, 190, 150)
"""Of who is really there, as the car says."""
VIRTUAL: Colour = (255, 150, 60)
"""Of who exists in a going simulation alone."""

REAL: Colour = (245, 246, 250)
TWIN: Colour = (0, 200, 255)
SHADOW: Colour = (178, 132, 255)
GHOST: Colour = (255, 120, 200)

PAGE: dict[str, Colour] = {
    "watch": WATCH,
    "danger": CRITICAL,
    "road-user": ROAD_USER,
    "twin": TWIN,
    "virtual": VIRTUAL,
}
"""What the co-pilot display takes of them, by the names of its style sheet; calm has no colour
there, so that who cannot tell red from green misses nothing."""
