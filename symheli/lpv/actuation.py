"""The way from a controller to the blades: commands held, a delay, then servos."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any, Protocol, TypeVar, runtime_checkable

from symheli.errors import InputError
from symheli.lpv.delay import delay_of, whole_samples
from symheli.lpv.in_series import Part, as_part
from symheli.lpv.linear_model import LinearModel
from symheli.lpv.lpv_state_space import LPVStateSpace
from symheli.values.numbers import by_name, finite, positive
from symheli.values.sample_period import same_period
from symheli.values.signal import indices

M = TypeVar("M", LinearModel, LPVStateSpace)


@runtime_checkable
class Actuator(Protocol):
    """A servo: anything that has a linear model."""

    def linear(self, name: str) -> LinearModel:
        """Return the linear model from `name`_command to `name`, continuous."""
        ...


@dataclass(frozen=True)
class Actuation:
    """An actuation is what stands between a controller and the blades: a hold, a delay, servos.

    Functions that take `servos` and `delay` take it as their `servos`.

    Parameters
    ----------
    servos : mapping, optional
        {input: Servo, LinearModel, LPVStateSpace or python-control system}; an input without one
        follows its command at once.
    delay : float
        From command to servo, s, of every input.
    period : float, optional
        Sample period of the controller, s, between whose samples commands are held; None:
        continuous.

    Raises
    ------
    InputError
        A servo of another kind, a negative delay, a period that is not positive.

    See Also
    --------
    symheli.Servo : lag, travel and rate of an actuator
    synthesis.Plant.behind : the same of a design plant

    Examples
    --------
    >>> servo = symheli.Servo(natural_frequency=33.0, damping=0.7)
    >>> actuation = lpv.tools.Actuation({"d_lat": servo}, delay=0.04, period=0.02)
    >>> roll = symheli.LinearModel([[-8.0]], [[120.0]], [[1.0]], [[0.0]], ["p"], ["d_lat"], ["p"])
    >>> actuation.discretize(roll).states
    ('p', 'd_lat_servo1', 'd_lat_servo2', 'd_lat_delay1', 'd_lat_delay2')
    """

    servos: Mapping[str, Any] | None = None
    delay: float = 0.0
    period: float | None = None

    def __post_init__(self) -> None:
        given = {} if self.servos is None else self.servos
        for name, servo in by_name(given, "servos", "{input: servo}").items():
            if not isinstance(servo, Actuator):
                _part(servo, name, None)
        if isinstance(self.delay, bool) or not finite(self.delay, "delay", "seconds") >= 0:
            raise InputError(f"delay: expected a number of seconds >= 0, got {self.delay!r:.80}")
        if self.period is not None:
            positive(self.period, "period")

    @classmethod
    def of(cls, servos: Any = None, delay: float = 0.0, period: float | None = None) -> Actuation:
        """Return the actuation of separate arguments; `servos` may be one already, without what
        the others give. Raises `InputError` where both give a delay, or another period.
        """
        if not isinstance(servos, Actuation):
            return cls(servos, delay, period)
        if delay and servos.delay:
            raise InputError(
                f"delay: {delay:g} s, and {servos.delay:g} s in the Actuation given as servos:"
                " leave one out"
            )
        if period and servos.period and not same_period(period, servos.period):
            raise InputError(
                f"period: {period:g} s, and the Actuation given as servos holds commands for"
                f" {servos.period:g} s: they must agree"
            )
        return replace(servos, delay=delay or servos.delay, period=period or servos.period)

    def select(self, inputs: Sequence[str]) -> Actuation:
        """Return the actuation with the servos of these inputs alone."""
        kept = {name: servo for name, servo in (self.servos or {}).items() if name in inputs}
        return replace(self, servos=kept or None)

    @property
    def samples(self) -> int:
        """Whole periods of the delay; `InputError` for a part of one, and without a period."""
        if self.delay and self.period is None:
            raise InputError(f"a delay of {self.delay:g} s counts sample periods: give period too")
        return whole_samples(self.delay, self.period) if self.delay and self.period else 0

    def parts(self, dt: float | None = None) -> dict[str, Part]:
        """Return the servos as systems by input: continuous, or with commands held for `dt` s."""
        return {name: _part(servo, name, dt) for name, servo in (self.servos or {}).items()}

    def behind(self, model: M, inputs: Sequence[str] | None = None) -> M:
        """Return a continuous model behind servos and Pade's delay, without the hold; a sampled
        one behind whole samples of delay.

        `inputs`: the controls; None: all inputs. Raises `InputError` for continuous servos of a
        sampled model, a delay that is no number of samples, and a servo of no input.
        """
        names = model.inputs if inputs is None else inputs
        indices(names, model.inputs, "input")
        servos = self.parts() if inputs is None else self.select(inputs).parts()
        late = {str(u): delay_of(str(u), self.delay, model.dt) for u in names} if self.delay else {}
        for parts in (servos, late):
            model = model.driven_by(parts) if parts else model  # type: ignore[arg-type]
        return model

    def discretize(self, model: M, inputs: Sequence[str] | None = None, **fit: Any) -> M:
        """Return a continuous model behind servos, sampled with its commands held for `period`,
        and behind the delay in whole samples; one so sampled only behind the delay.

        `inputs` as of `behind`; `fit`: options of `LPVStateSpace.discretize`. Raises `InputError`
        without a period, for a model of another one, and for servos of a sampled model.
        """
        if model.dt is None:
            if self.period is None:
                raise InputError("Actuation.discretize: give its period, s")
            model = replace(self, delay=0.0).behind(model, inputs).discretize(self.period, **fit)
        elif not same_period(model.dt, self.period) or self.select(model.inputs).servos:
            raise InputError(
                f"the plant is sampled every {model.dt:g} s: its controller must have that period,"
                f" got {self.period}, and its servos belong in front of the sampling"
            )
        return replace(self, servos=None).behind(model, inputs)


def _part(servo: Any, name: str, dt: float | None) -> Part:
    given = servo.linear(name) if isinstance(servo, Actuator) else servo
    return as_part(given, f"the actuator of {name}", "a Servo", dt, "hold")
