"""Packages that not every use needs: imported where they are used, missed by the name of what
brings them.
"""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager

from symheli.errors import InputError


@contextmanager
def extra(name: str, purpose: str) -> Iterator[None]:
    """Around the import of a package of the extra `name`: `InputError` that says how to get it
    where it is missing.

    with extra("logs", "reading a ULog file"):
        import pyulog
    """
    try:
        yield
    except ImportError as error:
        raise InputError(f"{purpose} needs {error.name}: pip install 'symheli[{name}]'") from error
