"""Output of a command: text for a reader, data for a program."""

from __future__ import annotations

import json
import math
import sys
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any


@dataclass(frozen=True)
class Output:
    """`text` is printed, or with --json `data`; `status` is the exit status."""

    text: str
    data: Mapping[str, Any]
    status: int = 0


def as_json(data: Any) -> str:
    """JSON of mappings, sequences, arrays and numbers; what is not finite becomes the string "inf",
    "-inf" or "nan".
    """
    return json.dumps(plain(data), indent=2, allow_nan=False)


def plain(value: Any) -> Any:
    """Return the same content in JSON types."""
    if isinstance(value, Mapping):
        return {str(key): plain(item) for key, item in value.items()}
    if hasattr(value, "tolist"):
        return plain(value.tolist())
    if isinstance(value, list | tuple | set | frozenset):
        return [plain(item) for item in value]
    if isinstance(value, complex):
        return {"real": plain(value.real), "imag": plain(value.imag)}
    if isinstance(value, float):
        return value if math.isfinite(value) else str(value)
    return value if value is None or isinstance(value, bool | int) else str(value)


def progress(message: str) -> None:
    """One line about what is going on, to stderr: stdout is for the answer."""
    print(message, file=sys.stderr, flush=True)


def columns(rows: list[list[str]], left: int = 1, gap: str = "  ") -> str:
    """Rows of text as aligned columns, the first `left` flush left, the others flush right."""
    from symheli.values import aligned  # with NumPy, which the command line starts without

    return aligned.columns(rows, left, gap)
