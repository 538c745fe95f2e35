"""Laws that take turns, each only inside its own invariant set."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from symheli.errors import InputError
from symheli.values.arrays import Array
from symheli.values.summary import summarized
from synthesis.sets.invariant_set import InvariantSet


@dataclass(frozen=True, eq=False)
class SwitchInside:
    """A switching law: a wanted law takes over where the state lies in its set, and not before.

    The state is then always in the set of the active law, which that law does not leave: no limit
    is exceeded, however often another is wanted, without a dwell time.

    Parameters
    ----------
    sets : sequence of InvariantSet
        Proven, of one model with different laws; each holds for parameters that move as its
        statement says.

    Raises
    ------
    InputError
        A set without a proof, or of other states or parameters than the first.

    Examples
    --------
    A slow law with a large set, and a fast one with a small set:

    >>> from symheli import LinearModel
    >>> plant = LinearModel([[0.0]], [[1.0]], [[1.0]], [[0.0]], ["x"], ["u"], ["x_m"])
    >>> slow, fast = (
    ...     synthesis.sets.invariant_set(plant, controller=[[k]], input_bounds={"u": 1.0})
    ...     for k in (-0.5, -5.0))
    >>> law = synthesis.sets.SwitchInside([slow, fast])
    >>> law.next([1.0], wanted=1, active=0), law.next([0.1], wanted=1, active=0)
    (0, 1)
    """

    sets: Sequence[InvariantSet]

    __repr__ = summarized

    def __post_init__(self) -> None:
        own = tuple(self.sets)
        if not own or not all(isinstance(one, InvariantSet) and one.verified for one in own):
            raise InputError("sets: expected InvariantSets with a proof (set.verified)")
        first = own[0].shape
        for one in own:
            if (one.shape.states, one.shape.box) != (first.states, first.box):
                raise InputError("sets: expected sets of one model, with the same states and range")
        object.__setattr__(self, "sets", own)

    def next(self, x: Any, wanted: int, active: int, *p: float) -> int:
        """The number of the law to apply at the state x (n,) and p, while `active` is applied."""
        for name, i in (("wanted", wanted), ("active", active)):
            if i not in range(len(self.sets)):
                raise InputError(f"{name}: expected 0 to {len(self.sets) - 1}, got {i!r:.60}")
        return wanted if self.sets[wanted].contains(x, *p) else active

    def control(self, x: Any, active: int, *p: float) -> Array:
        """u = K(p) x (nu,) of the active law."""
        return self.sets[active].gain(*p) @ np.asarray(x, dtype=float)
