"""A plugin of pytest: the modules that BLOCKED names cannot be imported."""

import os
import sys
from importlib.abc import MetaPathFinder

BLOCKED = tuple(filter(None, os.environ.get("BLOCKED", "").split(",")))


class Blocked(MetaPathFinder):
    """Finder that refuses them."""

    def find_spec(self, name, path=None, target=None):
        if any(name == module or name.startswith(f"{module}.") for module in BLOCKED):
            raise ModuleNotFoundError(f"{name} is blocked", name=name)


sys.meta_path.insert(0, Blocked())
