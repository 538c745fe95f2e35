"""Operators between systems, as a control engineer types them: P * K, P + Q, -P, P["y", "u"]."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import TYPE_CHECKING, Any

import numpy as np

from symheli.errors import InputError
from symheli.values.signal import Signal


class Operators:
    """What `LinearModel`, `LPVStateSpace`, `LFT` and `UncertainStateSpace` share: systems are
    multiplied and added like the matrices of their inputs and outputs.

    Signals connect by their order and not by their names. A product has the inputs of its right
    factor and the outputs of its left one; a sum has the names of its left operand. Systems of
    different kinds give one of the most general kind among them, see `symheli.lpv.connect`.

    Numbers, matrices and systems of python-control are operands too. A matrix is a static gain, and
    its channels are called u1.., y1... A number k times P is P with k times its outputs.

    Examples
    --------
    >>> from symheli import LinearModel
    >>> P = LinearModel([[-1.0]], [[1.0]], [[1.0]], [[0.0]], ["x"], ["u"], ["y"])
    >>> K = LinearModel.gain([[3.0]], ["e"], ["u"])
    >>> L = P * K
    >>> [str(s) for s in (*L.inputs, *L.outputs)], L(2.0).real.round(6).item()
    (['e', 'y'], 1.0)
    """

    __slots__ = ()

    if TYPE_CHECKING:
        inputs: tuple[Signal, ...]
        outputs: tuple[Signal, ...]
        parameters: Any
        select: Any

    __array_ufunc__ = None
    """An array times a system is `__rmul__`, not an array of systems."""
    __iter__ = None
    """No sequence of channels, although `P[outputs, inputs]` takes some."""

    def __mul__(self, other: Any) -> Any:
        """Connect two systems in series, y = P(K u): K first, then P, as in python-control.

        See Also
        --------
        symheli.lpv.series : the same, in the order of the signals: series(K, P)
        symheli.lpv.connect : connection by names
        """
        return _product(self, other)

    def __rmul__(self, other: Any) -> Any:
        """Multiply from the left by a number, a matrix or a system of python-control."""
        return _product(other, self)

    def __truediv__(self, number: Any) -> Any:
        """Divide the outputs by a number."""
        if not _is_number(number):
            return NotImplemented
        return _scaled(self, 1 / number)

    def __add__(self, other: Any) -> Any:
        """Connect two systems in parallel, y = P u + Q u.

        A number is added to a system of one input and one output only. For others write the matrix
        that is meant, `np.eye(n)` or `np.ones((ny, nu))` times the number.

        See Also
        --------
        symheli.lpv.parallel : the same as a function
        """
        return _sum(self, other)

    def __radd__(self, other: Any) -> Any:
        """Add to a number, a matrix or a system of python-control; 0 + P is P, as in `sum`."""
        from symheli.lpv.interconnection import parallel
        from symheli.lpv.linear_model import is_control_system

        return parallel(other, self) if is_control_system(other) else _sum(self, other)

    def __sub__(self, other: Any) -> Any:
        """Connect two systems in parallel with the sign of the second reversed, y = P u - Q u."""
        return _sum(self, _negative(other))

    def __rsub__(self, other: Any) -> Any:
        """Subtract from a number, a matrix or a system of python-control."""
        return (-self).__radd__(other)

    def __neg__(self) -> Any:
        """Reverse the sign of all outputs; the names stay."""
        return _scaled(self, -1.0)

    def __pos__(self) -> Any:
        """Return the system itself."""
        return self

    def __getitem__(self, key: Any) -> Any:
        """Keep channels: `P[outputs, inputs]`, each a name, a list of names, a position or a slice;
        every state stays.

        See Also
        --------
        LinearModel.select : the same, states too
        """
        if not isinstance(key, tuple) or len(key) != 2:
            raise InputError(
                f"expected P[outputs, inputs], such as P[{_first(self.outputs)!r},"
                f" {_first(self.inputs)!r}] or P[:, {_first(self.inputs)!r}], got P[{key!r}]"
            )
        outputs = _names(key[0], self.outputs, "output")
        inputs = _names(key[1], self.inputs, "input")
        return self.select(inputs=inputs, outputs=outputs)

    def __call__(self, s: Any) -> Any:
        """Refuse: a transfer matrix belongs to a model that is frozen, `P.at(p)(s)`.

        See Also
        --------
        LinearModel.__call__ : the transfer matrix at a point of the complex plane
        """
        names = ", ".join(each.name for each in self.parameters)
        at = f".at({names})(s)"
        raise InputError(
            f"{type(self).__name__} has a transfer matrix where its parameters are frozen only:"
            f" expected P{'.nominal' if hasattr(self, 'nominal') else ''}{at}, got P(s)"
        )


def _is_number(given: Any) -> bool:
    if isinstance(given, np.ndarray):
        return given.ndim == 0 and not np.iscomplexobj(given)
    return isinstance(given, int | float | np.number) and not isinstance(given, np.complexfloating)


def _product(left: Any, right: Any) -> Any:
    from symheli.lpv.interconnection import series

    if _is_number(left):
        return _scaled(right, left)
    return _scaled(left, right) if _is_number(right) else series(right, left)


def _sum(own: Any, other: Any) -> Any:
    """The sum under the names of `own`."""
    from symheli.lpv.interconnection import parallel

    if _is_number(other):
        if other == 0:
            return own
        if (len(own.inputs), len(own.outputs)) != (1, 1):
            raise InputError(
                f"a number is added to one input and one output, the system has {len(own.inputs)}"
                f" ({', '.join(own.inputs)}) and {len(own.outputs)} ({', '.join(own.outputs)}):"
                f" write {other:g} * np.eye(n) or {other:g} * np.ones((ny, nu)), whichever is meant"
            )
    return parallel(own, other)


def _negative(other: Any) -> Any:
    return -np.asarray(other) if isinstance(other, list) else -other


def _scaled(system: Any, factor: Any) -> Any:
    """The system with its outputs times a number, under its names; exact."""
    from symheli.lpv.interconnection import multiplied
    from symheli.lpv.linear_model import LinearModel

    if isinstance(system, LinearModel):  # about the same operating point
        return replace(system, C=factor * system.C + 0.0, D=factor * system.D + 0.0)  # no -0.0
    return multiplied(system, float(factor))


def _names(key: Any, known: Sequence[Signal], kind: str) -> list[str]:
    """The names that a key of `P[outputs, inputs]` stands for."""
    if isinstance(key, slice):
        return list(known[key])
    if isinstance(key, str):
        return [key]
    if isinstance(key, int | np.integer):
        if not -len(known) <= key < len(known):
            raise InputError(f"{kind} {key}: the system has {len(known)}: {', '.join(known)}")
        return [known[int(key)]]
    if not isinstance(key, Sequence | np.ndarray):
        raise InputError(
            f"{kind}: expected a name, a list of names, a position or a slice, got {key!r:.60}"
        )
    return [name for each in key for name in _names(each, known, kind)]


def _first(names: Sequence[Signal]) -> str:
    return str(names[0]) if names else ":"
