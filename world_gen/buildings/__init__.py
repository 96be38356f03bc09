"""Buildings of a map: outlines, parts, tags, and footprints in a World's frame."""
