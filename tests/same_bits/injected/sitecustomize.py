"""Python imports this as it starts, where its folder is on PYTHONPATH."""

import os

if "SAME_BITS_ROOT" in os.environ:
    import watched_imports

    watched_imports.watch(os.environ)
