"""CasADi functions called with NumPy arrays, without the cost of building CasADi matrices at each
call.
"""

from __future__ import annotations

from typing import Any

import casadi
import numpy as np

from symheli.errors import InputError


class Numeric:
    """`function(*arguments)` with float arrays in and a list of float arrays out: vectors (n,),
    matrices (n, m).

    `last`: values of the function's last arguments, the same at every call. Reuses its buffers: one
    thread at a time. Every argument is broadcast to the size the function expects.
    """

    def __init__(self, function: casadi.Function, *last: Any):
        sparse = [
            function.name_out(i)
            for i in range(function.n_out())
            if not function.sparsity_out(i).is_dense()
        ]
        if sparse:
            raise InputError(
                f"{function.name()}: outputs {', '.join(sparse)} are sparse; densify them first"
            )
        self.function = function
        arguments = [np.zeros(function.size_in(i), order="F") for i in range(function.n_in())]
        self._results = [np.zeros(function.size_out(i), order="F") for i in range(function.n_out())]
        buffer, self._evaluate = function.buffer()
        for i, array in enumerate(arguments):
            buffer.set_arg(i, memoryview(array.T.reshape(-1)))  # type: ignore[call-arg, arg-type]
        for i, array in enumerate(self._results):
            buffer.set_res(i, memoryview(array.T.reshape(-1)))  # type: ignore[call-arg, arg-type]
        self._buffer = buffer
        free = len(arguments) - len(last)
        self._arguments, self._last = arguments[:free], arguments[free:]
        self._columns = [array.shape[1] == 1 for array in self._arguments]
        for array, value in zip(self._last, last, strict=True):
            array[:, 0] = value

    def __call__(self, *arguments: Any) -> list[np.ndarray]:
        """Evaluate; raises `InputError` where an argument does not fit."""
        for array, column, value in zip(self._arguments, self._columns, arguments, strict=True):
            try:
                if column:
                    array[:, 0] = value
                else:
                    array[...] = value
            except ValueError as error:
                raise InputError(
                    f"{self.function.name()}: expected an argument of shape {array.shape}, got"
                    f" {np.shape(value)}"
                ) from error
        self._evaluate()
        return [r[:, 0].copy() if r.shape[1] == 1 else r.copy() for r in self._results]
