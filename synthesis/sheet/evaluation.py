"""Controllers held against a specification sheet over a scheduling parameter."""

from __future__ import annotations

import math
import time
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from symheli import LinearFamily, LinearModel, LPVStateSpace
from symheli.errors import InputError, UnknownNameError
from symheli.lpv.tools import Actuation
from symheli.progress import tracked
from symheli.threads import with_one_thread
from symheli.values.aligned import columns
from symheli.values.arrays import Array
from symheli.values.html_table import as_table
from symheli.values.labelled import frame
from symheli.values.signal import Signal
from symheli.values.summary import summarized
from synthesis.design.plant.as_controller import as_controller
from synthesis.sheet.measures import MEASURES, AxisLoop
from synthesis.sheet.probed import is_asked, probed
from synthesis.sheet.proven import Proven
from synthesis.sheet.sheet import Sheet, Specification

if TYPE_CHECKING:
    import pandas
    from matplotlib.axes import Axes

POINTS = 27
"""Values of the parameter at which a model is frozen, where a family does not say."""


class Reached(NamedTuple):
    """The worst value of one specification, the parameter there, and its design margin, percent.

    `at`: NaN of a flown entry. `value`: NaN where the loop is unstable (margin -inf), where nothing
    is defined, and where nothing was flown. `least`, `most`: of the values over the parameter.
    """

    specification: Specification
    value: float
    at: float
    margin: float
    least: float
    most: float

    @property
    def failure(self) -> str:
        """Why there is no value: "unstable" at some value of the parameter, or flights "lost"; ""
        where there is one.
        """
        if self.margin != -math.inf:
            return ""
        return "lost" if self.specification.kind == "flown" else "unstable"


@dataclass(frozen=True, kw_only=True, eq=False)
class SpecificationTable:
    """Values of the specifications of a sheet, by controller.

    Attributes
    ----------
    sheet : Sheet
        Scaled to the vehicle.
    parameter : Signal
        Over which the models are frozen.
    at : array (n,)
        Its values, in its unit.
    values : mapping
        {controller: array (m, n)} of the m frozen specifications, in their units: NaN where the
        loop is unstable and where a value is not defined.
    stable : mapping
        {controller: array (n,) of bool}.
    flown : mapping
        {controller: {(axis, name): value}} of flown specifications.
    proven : mapping
        {controller: tuple of Proven}: what is proven for every value of the parameter.
    seconds : mapping
        {what: computing time}, s.

    Examples
    --------
    >>> import symheli, synthesis
    >>> from synthesis.sheet.sheet import ControlAxis
    >>> lag = symheli.LinearModel([[-1.0]], [[2.0]], [[1.0]], [[0.0]], ("x",), ("u",), ("y",))
    >>> family = symheli.LinearFamily.from_models([0.0, 5.0], [lag, lag])
    >>> axis = ControlAxis(name="arm", control="u", response="y")
    >>> phase = Specification(
    ...     name="phase margin", axis="arm", measure="phase_margin", unit="deg", sense="at least",
    ...     level_1=45.0, level_2=22.5, source="project target", length=1.0)
    >>> sheet = Sheet(title="arm", axes={"arm": axis}, specifications=(phase,))
    >>> table = synthesis.specifications(family, {"P": {("u", "y"): -2.0}}, sheet)
    >>> print(table.over("P", "arm", "phase margin").round(1))  # of 4 / (s + 1)
    [104.5 104.5]
    >>> print(table.verdict("P"))
    1 of 1 entries that count are in Level 1; least margin 100 %: arm, phase margin
    """

    sheet: Sheet
    parameter: Signal
    at: Array
    values: Mapping[str, Array]
    stable: Mapping[str, Array]
    flown: Mapping[str, Mapping[tuple[str, str], float]] = field(default_factory=dict)
    proven: Mapping[str, tuple[Proven, ...]] = field(default_factory=dict)
    seconds: Mapping[str, float] = field(default_factory=dict)

    __repr__ = summarized
    _repr_html_ = as_table

    @property
    def controllers(self) -> tuple[str, ...]:
        """Names of the controllers."""
        return tuple(self.values)

    @property
    def frozen(self) -> tuple[Specification, ...]:
        """The m frozen specifications, as the rows of `values`."""
        return tuple(s for s in self.sheet.specifications if s.kind == "frozen")

    def over(self, controller: str, axis: str, name: str) -> Array:
        """Return the values (n,) of one frozen specification over the parameter."""
        self._known(controller)
        spec = self.sheet.of(axis, name)
        if spec.kind != "frozen":
            raise InputError(f"{axis}, {name} is flown: it has no value at each {self.parameter}")
        return self.values[controller][self.frozen.index(spec)]

    def reached(self, controller: str) -> list[Reached]:
        """Return the worst value of every specification, in the order of the sheet."""
        self._known(controller)
        rows, stable = iter(self.values[controller]), self.stable[controller]
        flown = self.flown.get(controller, {})
        return [
            _worst(spec, next(rows), self.at, stable)
            if spec.kind == "frozen"
            else _flown(spec, flown.get((spec.axis, spec.name), math.nan))
            for spec in self.sheet.specifications
        ]

    def missed(self, controller: str) -> list[Reached]:
        """Return the counted entries that miss Level 1, the furthest first."""
        each = [r for r in self.reached(controller) if r.specification.counts and r.margin < 0]
        return sorted(each, key=lambda r: r.margin)

    def entries(self, controller: str) -> list[dict[str, Any]]:
        """Return every specification with its boundaries, its worst value and those over the
        parameter, by name.
        """
        return [
            {
                "axis": r.specification.axis,
                "name": r.specification.name,
                "kind": r.specification.kind,
                "unit": r.specification.unit,
                "level_1": r.specification.level_1,
                "level_2": r.specification.level_2,
                "source": r.specification.source,
                "counts": r.specification.counts,
                "worst": r.value,
                "at": r.at,
                "margin": r.margin,
                "values": self.over(controller, r.specification.axis, r.specification.name)
                if r.specification.kind == "frozen"
                else None,
            }
            for r in self.reached(controller)
        ]

    def mark(self, controller: str) -> Reached:
        """Return the counted entry with the least design margin: 0 or more where the controller is
        in Level 1 in all that was computed.
        """
        counted = [
            r
            for r in self.reached(controller)
            if r.specification.counts and not math.isnan(r.margin)
        ]
        if not counted:
            raise InputError("no entry that counts has a value: evaluate frozen or flown ones")
        return min(counted, key=lambda r: r.margin)

    def with_flown(
        self, flown: Mapping[str, Mapping[tuple[str, str], float]], seconds: float
    ) -> SpecificationTable:
        """Return the table with values of flown specifications and the time they took, s."""
        return replace(self, flown=flown, seconds={**self.seconds, "flown": seconds})

    def with_proven(
        self, proven: Mapping[str, tuple[Proven, ...]], seconds: float
    ) -> SpecificationTable:
        """Return the table with proofs over the interval and the time they took, s."""
        return replace(self, proven=proven, seconds={**self.seconds, "proven": seconds})

    def to_frame(self) -> pandas.DataFrame:
        """Return the worst values as a pandas frame, a row a controller and specification."""
        each = [(c, r) for c in self.controllers for r in self.reached(c)]
        names = {
            "controller": [c for c, _ in each],
            "axis": [r.specification.axis for _, r in each],
            "specification": [r.specification.name for _, r in each],
        }
        numbers = {
            Signal("value"): [r.value for _, r in each],
            Signal(f"{self.parameter}", self.parameter.unit): [r.at for _, r in each],
            Signal("margin", "%"): [r.margin for _, r in each],
        }
        return frame(
            [(Signal(n), np.array(v)) for n, v in names.items()],
            [(n, np.array(v)) for n, v in numbers.items()],
        )

    def plot(self, axis: str, controller: str | None = None, ax: Axes | None = None) -> Axes:
        """Plot the design margins of an axis, levels shaded, a mark a value of the parameter; of
        one controller, or of the first. Returns the axes.
        """
        from synthesis.sheet.picture import plot_margins

        return plot_margins(self, axis, controller or self.controllers[0], ax)

    def __str__(self) -> str:
        return "\n\n".join(self.text(c) for c in self.controllers)

    def text(self, controller: str) -> str:
        """Return the sheet of one controller as a table of text."""
        s = self.parameter
        head = ["axis", "specification", "unit", "Level 1", "worst", f"at {s} ({s.unit})", "margin"]
        rows = [head, ["", "", "", "", "", "", "%"]]
        last = ""
        for r in self.reached(controller):
            spec = r.specification
            rows.append(
                [
                    spec.axis if spec.axis != last else "",
                    spec.name,
                    spec.unit,
                    boundary(spec),
                    worst(r),
                    "" if math.isnan(r.at) else f"{r.at:.4g}",
                    margin(r),
                ]
            )
            last = spec.axis
        return "\n".join([f"{controller}: {self.verdict(controller)}", "", columns(rows, left=3)])

    def verdict(self, controller: str) -> str:
        """Return in a sentence how many counted entries are in Level 1, and the worst of them."""
        counted = [r for r in self.reached(controller) if r.specification.counts]
        known = [r for r in counted if not math.isnan(r.margin)]
        if not known:
            return "nothing that counts was computed"
        stable = self.stable[controller]
        if not stable.all():
            return (
                f"unstable at {int((~stable).sum())} of {len(stable)} values of {self.parameter},"
                f" first at {self.at[~stable][0]:.4g} {self.parameter.unit}"
            )
        inside = sum(r.margin >= 0 for r in known)
        least = min(known, key=lambda r: r.margin)
        spec = least.specification
        missing = len(counted) - len(known)
        return (
            f"{inside} of {len(known)} entries that count are in Level 1; least margin"
            f" {least.margin:.0f} %: {spec.axis}, {spec.name}"
            + (f"; {missing} not flown or not defined" if missing else "")
        )

    def _known(self, controller: str) -> None:
        if controller not in self.values:
            raise UnknownNameError("controller", controller, self.values)


def boundary(spec: Specification) -> str:
    """Return the boundary of Level 1 in words; "not confirmed" where none is."""
    if not spec.sense:
        return spec.source
    sign = ">=" if spec.sense == "at least" else "<="
    return f"{sign} {spec.level_1:.4g}"


def worst(r: Reached) -> str:
    """Return the worst value in words: without boundaries, the range."""
    if r.failure:
        return r.failure
    if not r.specification.sense and r.least < r.most:
        return f"{r.least:.4g} to {r.most:.4g}"
    return "" if math.isnan(r.value) else f"{r.value:.4g}"


def margin(r: Reached) -> str:
    """Return the design margin in words, in brackets where it does not count."""
    if math.isnan(r.margin):
        return ""
    text = f"{r.margin:.0f}"
    return text if r.specification.counts else f"({text})"


@with_one_thread
def specifications(
    plant: LinearFamily | LPVStateSpace,
    controllers: Any,
    sheet: Sheet | None = None,
    *,
    at: Sequence[float] | Array | None = None,
    length: float | None = None,
    servos: Mapping[str, object] | Actuation | None = None,
    delay: float = 0.0,
    travel: Mapping[str, float] | None = None,
    rate_limit: Mapping[str, float] | None = None,
) -> SpecificationTable:
    """Evaluate the frozen specifications of a sheet for controllers over a scheduling parameter.

    Every loop is closed as it flies: servos, the exact models sampled with the commands held, the
    delay in whole samples, the controller at the same value of the parameter.

    Parameters
    ----------
    plant : LinearFamily or LPVStateSpace
        Over one parameter, with the controls as inputs and the measurements as outputs; continuous,
        or sampled as the controllers are.
    controllers : mapping, or one controller
        {name: controller}, each one that `Plant.close` takes, or one with `dt`, `reset` or `init`,
        and `step`, of which the linear model is found from its commands; it reads measured minus
        reference.
    sheet : Sheet, optional
        By default the packaged one of a small helicopter.
    at : sequence of float, optional
        Values of the parameter; by default the grid of a family, or `POINTS` values of a model.
    length : float, optional
        Rotor radius of the vehicle, m, to which the sheet is scaled; by default it is not.
    servos : mapping or Actuation, optional
        {control: Servo, LinearModel or python-control system} in front of a continuous plant.
    delay : float
        From a command to its servo, s.
    travel, rate_limit : mapping, optional
        {control: largest deflection from the middle} and {control: fastest change, per second};
        what needs them is not defined without.

    Returns
    -------
    SpecificationTable
        With the values at each frozen model, worst values and design margins.

    Raises
    ------
    InputError
        A plant over several parameters, another kind of controller, a sample period that does not
        fit, an axis without definition, a controller with none of the axes.
    UnknownNameError
        A signal or a measure that is not there.

    See Also
    --------
    synthesis.sheet.Sheet : the requirements
    synthesis.margin_table : margins over the parameters

    Examples
    --------
    >>> import numpy as np, symheli, synthesis
    >>> from synthesis.sheet.sheet import ControlAxis, Sheet, Specification
    >>> p = symheli.Scheduling("p", "1", 0.0, 1.0)
    >>> cart = symheli.LPVStateSpace.polynomial(
    ...     [[[0.0]]], [[[1.0]], [[1.0]]], [[[1.0]]], [[[0.0]]], p, inputs=("f",), outputs=("v",))
    >>> sheet = Sheet(
    ...     title="cart", axes={"speed": ControlAxis(name="speed", control="f", response="v")},
    ...     specifications=(Specification(
    ...         name="rejection", axis="speed", measure="rejection_bandwidth", unit="rad/s",
    ...         sense="at least", level_1=2.0, level_2=1.0, source="project target", length=1.0),))
    >>> table = synthesis.specifications(cart, {"P": {("f", "v"): -3.0}}, sheet, at=[0.0, 1.0])
    >>> print(table.over("P", "speed", "rejection").round(2))  # 3 (1 + p) / sqrt(10^0.3 - 1)
    [3.01 6.01]
    >>> print(f"{table.mark('P').margin:.0f} % at p = {table.mark('P').at:g}")
    100 % at p = 0
    """
    sheet = Sheet.load() if sheet is None else sheet
    sheet = sheet if length is None else sheet.at_length(length)
    entries = [s for s in sheet.specifications if s.kind == "frozen"]
    for spec in entries:
        if spec.measure not in MEASURES:
            raise UnknownNameError("measure", spec.measure, MEASURES)
        if spec.axis not in sheet.axes:
            raise InputError(f"{spec.axis}, {spec.name}: the sheet does not define this axis")
    parameter, values = _grid(plant, at)
    actuation = Actuation.of(servos, delay)
    given = controllers if _by_name(controllers) else {"controller": controllers}
    begin = time.perf_counter()
    found: dict[str, Array] = {}
    stable: dict[str, Array] = {}
    jobs = [(name, k) for name in given for k in range(len(values))]
    plants: dict[tuple[int, tuple[str, ...], float | None], LinearModel] = {}
    for name, k in tracked("specifications", jobs, len(jobs)):
        if name not in found:
            found[name] = np.full((len(entries), len(values)), math.nan)
            stable[name] = np.zeros(len(values), bool)
        p = float(values[k])
        bare = plant.at(p)
        K = frozen_controller(given[name], bare, parameter, p, actuation.period)
        driven = tuple(K.outputs)
        if (k, driven, K.dt) not in plants:
            plants[k, driven, K.dt] = driven_plant(bare, K, actuation)
        loops = axis_loops(plants[k, driven, K.dt], K, sheet, travel, rate_limit)
        if not loops:
            raise InputError(
                f"{name}: the controller has none of the axes of the sheet,"
                f" {', '.join(f'{a.response} -> {a.control}' for a in sheet.axes.values())}; it is"
                f" from {', '.join(K.inputs)} to {', '.join(driven)}"
            )
        stable[name][k] = next(iter(loops.values())).stable
        for i, spec in enumerate(entries if stable[name][k] else ()):
            if spec.axis in loops:
                found[name][i, k] = MEASURES[spec.measure](loops[spec.axis], spec)
    seconds = {"frozen": time.perf_counter() - begin}
    return SpecificationTable(
        sheet=sheet,
        parameter=parameter,
        at=values,
        values=found,
        stable=stable,
        seconds=seconds,
    )


def axis_loops(
    plant: LinearModel,
    K: LinearModel,
    sheet: Sheet,
    travel: Mapping[str, float] | None = None,
    rate_limit: Mapping[str, float] | None = None,
) -> dict[str, AxisLoop]:
    """Return the loop of every axis of a sheet that the frozen controller has."""
    return {
        axis.name: AxisLoop(
            plant=plant,
            controller=K,
            axis=axis,
            travel=(travel or {}).get(axis.control, math.nan),
            rate_limit=(rate_limit or {}).get(axis.control, math.nan),
        )
        for axis in sheet.axes.values()
        if axis.control in K.outputs and axis.response in K.inputs
    }


def driven_plant(model: LinearModel, K: LinearModel, actuation: Actuation) -> LinearModel:
    """Return a frozen model behind the actuation of a frozen controller, sampled as that is."""
    own = Actuation.of(actuation.select(K.outputs), period=K.dt)
    model = model.select(inputs=K.outputs)
    return own.behind(model) if model.dt is own.period is None else own.discretize(model)


def frozen_controller(
    given: Any, plant: LinearModel, parameter: Signal, p: float, period: float | None = None
) -> LinearModel:
    """Return a controller of any kind, frozen at p, with the signals of the plant; a gain without
    states has the sample period of the plant, or else the given one.
    """
    model = getattr(given, "model", None)
    if is_asked(given) and not isinstance(model, LPVStateSpace):
        return probed(given, plant.outputs, plant.inputs, parameter, p)
    K = as_controller(given, plant.inputs, plant.outputs)
    if isinstance(K, LPVStateSpace):
        if len(K.parameters) != 1:
            raise InputError(
                f"the controller is scheduled by {', '.join(s.name for s in K.parameters)}: one"
                " parameter is expected; fix the others"
            )
        K = K.at(p)
    return replace(K, dt=plant.dt or period) if not K.states and K.dt is None else K


def _by_name(given: Any) -> bool:
    """Whether these are controllers by name, and not the gains of one."""
    return isinstance(given, Mapping) and all(isinstance(name, str) for name in given)


def _grid(plant: Any, at: Sequence[float] | Array | None) -> tuple[Signal, Array]:
    if isinstance(plant, LinearFamily):
        parameter = plant.parameter
        return parameter, np.array(plant.airspeeds if at is None else at, dtype=float)
    if not isinstance(plant, LPVStateSpace) or len(plant.parameters) != 1:
        raise InputError(
            "plant: expected a LinearFamily or an LPVStateSpace over one parameter, got"
            f" {type(plant).__name__}"
        )
    s = plant.scheduling
    values = np.linspace(s.low, s.high, POINTS) if at is None else np.array(at, dtype=float)
    if values.ndim != 1 or not len(values) or not np.isfinite(values).all():
        raise InputError("at: expected a list of finite values of the parameter")
    return Signal(s.name, s.unit), values


def _worst(spec: Specification, values: Array, at: Array, stable: Array) -> Reached:
    known = values[~np.isnan(values)]
    least, most = (known.min(), known.max()) if len(known) else (math.nan, math.nan)
    if not stable.all():
        return Reached(spec, math.nan, float(at[~stable][0]), -math.inf, least, most)
    if not len(known):
        return Reached(spec, math.nan, math.nan, math.nan, least, most)
    k = int(np.nanargmin(values) if spec.sense != "at most" else np.nanargmax(values))
    value = float(values[k])
    return Reached(spec, value, float(at[k]), spec.design_margin(value), float(least), float(most))


def _flown(spec: Specification, value: float) -> Reached:
    return Reached(spec, value, math.nan, spec.design_margin(value), value, value)
