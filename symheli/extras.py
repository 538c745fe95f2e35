"""Optional packages: imported where they are used; the error for a missing one names the extra that
installs it.
"""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager

from symheli.errors import InputError


@contextmanager
def extra(name: str, purpose: str) -> Iterator[None]:
    """Guard the import of a package of the extra `name`: raise `InputError` with the installation
    command where it is missing.

    with extra("logs", "reading a ULog file"):
        import pyulog
    """
    try:
        yield
    except ImportError as error:
        raise InputError(f"{purpose} needs {error.name}: pip install 'symheli[{name}]'") from error
