"""Whether a record can determine a structure: rank, spectrum, and what is missing in words."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass

import numpy as np

from identification.design.criterion import Criterion, judged, table
from identification.design.determined import determined_columns
from identification.design.never_determined import never_determined
from identification.design.tall_factors import triangular
from identification.structure.lpvarx import LPVARX, EquationGroup
from identification.structure.regressors import Regression, as_records, stacked
from symheli.errors import ExcitationError
from symheli.records import FlightRecord
from symheli.values.arrays import Array
from symheli.values.summary import summarized

RANK_TOLERANCE = 1e-11
"""A direction with a singular value below this fraction of the largest is lost to rounding (columns
scaled to length 1).
"""

DISTINCT_TOLERANCE = 1e-6
"""Two scheduling values closer than this fraction of the range count as one."""

BINS = 10


@dataclass(frozen=True, eq=False, kw_only=True)
class ExcitationReport:
    """Excitation of the scheduled regressors in a record, with the coefficients that it determines.

    Where the equations differ in their regressors, this is the report on the worst of them.

    Parameters
    ----------
    names : tuple of str
        The n regressors.
    samples : int
        Complete rows.
    rank : int
        How many regressors are determined (`identification.design.determined`).
    singular_values : array (n,)
        Of the regressor matrix with columns scaled to length 1, largest first.
    condition : float
        Their ratio.
    distinct, needed : int
        Scheduling values found, and needed by the basis.
    edges, occupancy : array
        Samples in each of the bins with these edges (unit of p) over the range of the basis, a row
        for each of several parameters.
    weakest : array (n,)
        The direction the data determine worst, in scaled regressors.
    scheduling : str
        The parameters, by name.
    reason : str
        Why the data do not suffice; empty where they do.
    outputs : tuple of str
        Whose equations these are.

    Examples
    --------
    >>> report = idn.excitation_report(arx, record)
    >>> report.sufficient, report.rank, report.needed
    (True, 4, 2)
    """

    names: tuple[str, ...]
    samples: int
    rank: int
    singular_values: Array
    condition: float
    distinct: int
    needed: int
    edges: Array
    occupancy: Array
    weakest: Array
    scheduling: str
    reason: str
    outputs: tuple[str, ...] = ()

    __repr__ = summarized

    @property
    def sufficient(self) -> bool:
        """Whether every coefficient is determined."""
        return not self.reason

    @property
    def criteria(self) -> tuple[Criterion, ...]:
        """Samples, rank, and scheduling values that differ, beside what the structure needs."""
        n = len(self.names)
        found = [("samples", self.samples, n), ("rank of the regressors", self.rank, n)]
        if self.needed > 1:
            found.append((f"distinct values of {self.scheduling}", self.distinct, self.needed))
        return tuple(judged(*row, sense="at least") for row in found)

    @property
    def worst_direction(self) -> str:
        """The combination of scaled regressors the data determine worst, its largest parts
        first.
        """
        return direction_in_words(self.weakest, self.names)

    def require(self) -> None:
        """Raises `ExcitationError` with the reason unless the data suffice."""
        if self.reason:
            raise ExcitationError(self.reason, self)

    def __str__(self) -> str:
        verdict = "sufficient" if self.sufficient else f"NOT sufficient: {self.reason}"
        return "\n".join(
            [
                f"excitation: {verdict}",
                table(self.criteria, "  "),
                f"  scaled condition: {self.condition:.3g}",
                f"  worst determined: {self.worst_direction}",
                *(self._bars() if self.needed > 1 else []),
            ]
        )

    def _bars(self) -> list[str]:
        out = []
        names = self.scheduling.split(", ")
        for name, edges, occupancy in zip(
            names, np.atleast_2d(self.edges), np.atleast_2d(self.occupancy), strict=True
        ):
            full = max(int(occupancy.max(initial=0)), 1)
            out.append(f"  samples over {name}:")
            for a, b, n in zip(edges[:-1], edges[1:], occupancy, strict=True):
                out.append(f"  {a:9.3g} .. {b:<9.3g} {int(n):7d} {'#' * round(40 * int(n) / full)}")
        return out


def excitation_report(
    arx: LPVARX, records: FlightRecord | Iterable[FlightRecord]
) -> ExcitationReport:
    """Report whether these records determine the coefficients of a structure; nothing is raised for
    poor data.

    Parameters
    ----------
    arx : LPVARX
        What is to be identified.
    records : FlightRecord or iterable of FlightRecord
        Of one sample period.

    Returns
    -------
    ExcitationReport
        `str()` of it is a page with the occupancy of the range of p.

    Raises
    ------
    UnknownNameError
        A signal the records lack.
    InputError
        The scheduling parameter leaves the range of the basis.

    See Also
    --------
    identification.choose_experiments : the most informative flights
    identification.uncertainty : covariance that coloured residuals allow

    Examples
    --------
    Two values of p do not determine a cubic:

    >>> two = record.with_signals({"p": "1"}, p=np.sign(record["p"]))
    >>> cubic = idn.LPVARX("y", "u", "p", na=1, nb=1, delay=1, basis=idn.Polynomial(3, -1.0, 1.0))
    >>> report = idn.excitation_report(cubic, two.rows(record["p"] != 0))
    >>> report.sufficient, report.distinct, report.needed
    (False, 2, 4)
    """
    return excitation_of(arx, stacked(arx, as_records(records)))


def excitation_of(arx: LPVARX, data: Regression) -> ExcitationReport:
    """Return the report for regressors already built."""
    reports = [_report(arx, data, group) for group in arx.groups]
    return max(reports, key=lambda report: (not report.sufficient, report.condition))


def _report(arx: LPVARX, data: Regression, group: EquationGroup) -> ExcitationReport:
    regressors = arx.regressors(group)
    names, n = tuple(arx.regressor_names[i] for i in regressors), len(regressors)
    values, directions = spectrum(data.phi[:, regressors])
    rank = int(np.sum(determined_columns(data.phi[:, regressors], arx.basis)))
    ranges, scheduling = arx.basis.ranges, ", ".join(arx.parameters)
    distinct, needed = distinct_values(data.p, ranges), arx.basis.distinct_values
    bins = [
        np.histogram(p, bins=BINS, range=limits)
        for p, limits in zip(data.p.reshape(-1, len(ranges)).T, ranges, strict=True)
    ]
    occupancy, edges = (
        np.array(parts[0] if len(ranges) == 1 else parts) for parts in zip(*bins, strict=True)
    )
    weakest = directions[-1]
    reason = ""
    if len(data.phi) < n:
        reason = (
            f"{len(data.phi)} usable samples cannot determine {n} coefficients an output; record"
            f" longer, or lower na, nb or the size of the basis ({data.dropped} samples had no"
            " complete regressor)"
        )
    elif distinct < needed:
        smaller = f" (a polynomial of degree {distinct - 1} at most)" if len(ranges) == 1 else ""
        reason = (
            f"{scheduling} takes {distinct} distinct values and {arx.basis} needs {needed}; "
            f"let {scheduling} visit more values, or choose a smaller basis{smaller}"
        )
    elif rank < n:
        reason = never_determined(arx, group) or (
            f"the regressors have rank {rank} of {n}: the data do not determine"
            f" {direction_in_words(weakest, names)}; excite the inputs more richly while"
            f" {scheduling} moves, or lower na, nb or the size of the basis"
        )
    return ExcitationReport(
        names=names,
        samples=len(data.phi),
        rank=rank,
        singular_values=values,
        condition=values[0] / values[-1] if values[-1] > 0 else np.inf,
        distinct=distinct,
        needed=needed,
        edges=edges,
        occupancy=occupancy,
        weakest=weakest,
        scheduling=scheduling,
        reason=reason,
        outputs=tuple(arx.outputs[y] for y in group.outputs),
    )


def column_scale(matrix: Array) -> Array:
    """Length of each column, 1 where it is zero."""
    scale = np.linalg.norm(matrix, axis=0)
    return np.where(scale > 0, scale, 1.0)


def spectrum(phi: Array) -> tuple[Array, Array]:
    """Singular values (n,), padded with zeros, and right singular vectors (n, n) of `phi` with
    columns of length 1.
    """
    n = phi.shape[1]
    R = triangular(phi / column_scale(phi)) if len(phi) else np.zeros((0, n))
    _, values, directions = np.linalg.svd(R, full_matrices=True)
    return np.pad(values, (0, n - len(values))), directions


def distinct_values(p: Array, ranges: Sequence[tuple[float, float]]) -> int:
    """Number of scheduling points p (m,) or (m, parameters) further apart than rounding, measured
    by the ranges of the basis.
    """
    if len(p) == 0:
        return 0
    scaled = p.reshape(len(p), -1) / [high - low for low, high in ranges]
    if len(ranges) == 1:
        return 1 + int(np.sum(np.diff(np.sort(scaled[:, 0])) > DISTINCT_TOLERANCE))
    return len(np.unique(np.round(scaled / DISTINCT_TOLERANCE), axis=0))


def direction_in_words(direction: Array, names: tuple[str, ...], parts: int = 3) -> str:
    """Return the largest entries of a direction, such as "0.71 u(k-1) f0(p(k-1)) - 0.70 u(k-2)
    f0(p(k-2))".
    """
    largest = [
        i for i in np.argsort(-np.abs(direction), kind="stable")[:parts] if abs(direction[i]) > 0.05
    ]
    sign = np.sign(direction[largest[0]])
    text = " ".join(
        f"{'+' if sign * direction[i] >= 0 else '-'} {abs(direction[i]):.2f} {names[i]}"
        for i in largest
    )
    return text.removeprefix("+ ") + (" + ..." if np.sum(np.abs(direction) > 0.05) > parts else "")
