"""The kinds of statement about a model."""

from __future__ import annotations

from typing import TYPE_CHECKING, Literal

if TYPE_CHECKING:
    pass


Kind = Literal["l2 gain", "stability", "energy-to-peak gain", "h2 gain", "decay rate"]
