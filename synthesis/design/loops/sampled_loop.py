"""Certificate of a sampled loop: the controller as implemented around the sampled plant.

How a controller was made plays no part in it: synthesis may be as rough as it likes, and what
sampling, tabulating, rounding and delay take is the distance between two gains.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any

import numpy as np

from symheli import LPVStateSpace, UncertainStateSpace
from symheli.errors import InputError
from symheli.threads import with_one_thread
from symheli.values.html_table import as_table
from symheli.values.summary import summarized
from synthesis.certify.questions.certificate import Certificate
from synthesis.certify.questions.questions import l2_gain
from synthesis.certify.statement.rates import Rate
from synthesis.design.loops.controller import Controller
from synthesis.design.plant.plant import Plant, require_plant

if TYPE_CHECKING:
    from matplotlib.axes import Axes

ROUNDING = 256 * np.finfo(float).eps
"""A misfit of an entry of the performance below this fraction of its own terms, at the same p, is
rounding, whatever the units.
"""


@dataclass(frozen=True, eq=False, kw_only=True)
class SampledLoop:
    """A controller as implemented around its sampled plant, with the certificate of that loop.

    Attributes
    ----------
    loop : LPVStateSpace or UncertainStateSpace
        What was analysed: the sampled plant under the numbers that fly; where the plant is a fit,
        with every model that it was fitted to.
    certificate : Certificate
        Of its gain from the disturbances to the performance.
    promised : float
        The gain that the synthesis promised, for its own plant; NaN where none is known.
    misfit : float
        Largest entry of [A B] by which the loop misses what its plant was fitted to; 0 of a plant
        that was given as it is.

    Examples
    --------
    >>> import numpy as np, symheli, synthesis
    >>> p = symheli.Scheduling("p", "1", 0.0, 1.0, rate=0.1)
    >>> lag = symheli.LPVStateSpace.polynomial(
    ...     [[[0.9]], [[0.05]]], [[[0.1, 0.1]]], [[[1.0]]], [[[0.0, 0.0]]], p, dt=0.1,
    ...     inputs=("w", "u"), outputs=("y",))
    >>> plant = synthesis.Plant(lag, disturbances=["w"], performance=["y"], controls=["u"],
    ...                         measurements=["y"])
    >>> sampled = synthesis.certify_sampled({("u", "y"): -0.5}, plant, promised=0.9, search=None)
    >>> print(sampled)
    synthesis promised 0.9; the sampled loop is proven for 1 (frozen 1): 11.1 % more
    """

    loop: LPVStateSpace | UncertainStateSpace
    certificate: Certificate
    promised: float = math.nan
    misfit: float = 0.0

    __repr__ = summarized
    _repr_html_ = as_table

    def plot(self, ax: Axes | None = None) -> Axes:
        """Draw the bounds of the certificate; see `Certificate.plot`."""
        return self.certificate.plot(ax)

    @property
    def gamma(self) -> float:
        """Proven gain, inf without a proof."""
        return self.certificate.gamma

    @property
    def loss(self) -> float:
        """Proven gain over the promised one, minus 1: the total effect of sampling, fit and
        implementation; inf without a proof, NaN where nothing was promised.
        """
        return self.gamma / self.promised - 1.0

    def __str__(self) -> str:
        promised = "" if math.isnan(self.promised) else f"promised {self.promised:.4g}"
        begin = f"synthesis {promised}; " if promised else ""
        frozen = f"frozen {self.certificate.frozen:.4g}"
        if not self.certificate.verified:
            return f"{begin}nothing is proven of the sampled loop ({frozen}):" + (
                f" {self.certificate.status}"
            )
        first = f"{begin}the sampled loop is proven for {self.gamma:.4g} ({frozen})"
        if not promised:
            return first
        return f"{first}: {abs(100 * self.loss):.3g} % {'more' if self.loss >= 0 else 'less'}"


@with_one_thread
def certify_sampled(
    controller: Any,
    plant: Plant,
    rate: Rate = None,
    *,
    promised: float | None = None,
    cover: bool = True,
    **options: Any,
) -> SampledLoop:
    """Certify the gain of a sampled plant under a controller as implemented.

    Parameters
    ----------
    controller : Controller, TableController, LPVStateSpace or what else `Plant.close` takes
        Sampled as the plant is, a table with its numbers of 32 bits; a `Controller` in continuous
        time is sampled first, by Tustin's rule.
    plant : Plant
        Sampled, its delay exact: `plant.with_servo(...).sampled(dt).with_delay(dt)`.
    rate : float, sequence or mapping, optional
        Largest |dp/dt|, as for `l2_gain`; by default the plant's own.
    promised : float, optional
        The promised gain to compare with; by default that of a `Controller`.
    cover : bool
        Whether the proof holds for every model within twice the distance that the plant misses
        what it was fitted to by (its `.residuals`); otherwise for the fit alone.
    **options
        Of `l2_gain`.

    Returns
    -------
    SampledLoop
        With the certificate and the loss from the promised to the proven gain.

    Raises
    ------
    InputError
        A plant or a controller in continuous time, a fit whose performance is missed too.

    See Also
    --------
    synthesis.l2_gain : worst-case gain while p moves
    synthesis.Controller : what a design returns

    Examples
    --------
    >>> import synthesis
    >>> from symheli import LinearModel
    >>> lag = LinearModel([[0.9]], [[0.1, 0.1]], [[1.0]], [[0.0, 0.0]], ("x",), ("w", "u"), ("y",),
    ...                   dt=0.1)
    >>> plant = synthesis.Plant(lag, disturbances=["w"], performance=["y"], controls=["u"],
    ...                         measurements=["y"])
    >>> print(certify_sampled({("u", "y"): -1.0}, plant, search=None))
    the sampled loop is proven for 0.5 (frozen 0.5)
    """
    require_plant(plant)
    if plant.dt is None:
        raise InputError(
            "the plant is continuous, but the controller as implemented is sampled: use"
            " plant.with_servo(...).sampled(dt).with_delay(dt)"
        )
    if isinstance(controller, Controller):
        promised = controller.promised if promised is None else promised
        controller = controller if controller.dt else controller.discretize(plant.dt)
    loop = plant.close(controller)
    misfit = 0.0
    if cover and isinstance(loop, LPVStateSpace) and loop.residuals is not None:
        loop, misfit = _covered(loop)
    certificate = l2_gain(loop, rate, **options)
    return SampledLoop(
        loop=loop,
        certificate=certificate,
        promised=math.nan if promised is None else float(promised),
        misfit=misfit,
    )


def _covered(loop: LPVStateSpace) -> tuple[LPVStateSpace | UncertainStateSpace, float]:
    """Return the set of models around a fit, and the largest misfit of an entry of [A B]."""
    assert loop.residuals is not None  # noqa: S101
    nodes, A, B, C, D = loop.residuals
    functions = np.abs(loop.basis(nodes))
    for missed, of in ((C, loop.C), (D, loop.D)):
        left = np.abs(missed) > ROUNDING * np.tensordot(functions, np.abs(of), axes=1)
        if np.any(left):
            _, i, _ = np.argwhere(left)[0]
            raise InputError(
                f"the performance of the plant is also a fit, {loop.outputs[i]} by"
                f" {np.abs(missed[:, i]).max():.2g}: put what varies behind a state (a servo, a"
                " filter), or give cover=False for a proof of the fit alone"
            )
    missed = np.concatenate([A, B], axis=2)
    largest = float(np.abs(missed).max(initial=0.0))
    bare = replace(loop, residuals=None)
    return (UncertainStateSpace.covering(bare, missed), largest) if largest > 0 else (bare, 0.0)
