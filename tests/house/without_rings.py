"""A plugin of pytest: modules of the rings that BLOCKED_RINGS names cannot be imported."""

import os
import sys
from importlib.abc import MetaPathFinder

BLOCKED = tuple(filter(None, os.environ.get("BLOCKED_RINGS", "").split(",")))


class Blocked(MetaPathFinder):
    """Finder that refuses them."""

    def find_spec(self, name, path=None, target=None):
        if any(name == ring or name.startswith(f"{ring}.") for ring in BLOCKED):
            raise ImportError(f"{name} is blocked")


sys.meta_path.insert(0, Blocked())
