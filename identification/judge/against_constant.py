"""A scheduled model beside the constant one of the same order, in sample and held out."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Literal

import numpy as np

from identification.design.leakage import MADE_OF_OUTPUTS, share_from_outputs
from identification.estimators.estimate import fit
from identification.estimators.method import Method
from identification.judge.scores import LOST, Scores, horizons, percent, scores
from identification.model.lpvarx_model import LPVARXModel
from identification.structure.lpvarx import LPVARX
from symheli.errors import ExcitationError, InputError, UnknownNameError
from symheli.progress import tracked
from symheli.records import FlightRecord
from symheli.values.summary import summarized

PAYS = 1.0
"""Points of held-out fit by which one model must beat another to be called better; what is printed
(one digit) is what is compared.
"""

LEAST = -100.0
"""A fit below this counts as this, where fits are averaged: what is useless can be no worse."""

HORIZONS = horizons()
"""One step, 1 s and free run; the verdict rests on the last two."""

Verdict = Literal["pays", "pays for prediction only", "does NOT pay"]
"""The worth of scheduling for an output: better in free run, which simulation and feedback rest
on, and no worse 1 s ahead; better 1 s ahead alone; or neither.
"""

Trim = Literal["auto", "moving", "still"]
"""Whether the models have d(p) times the change of p (`offset_rate`): "auto" tries both."""


@dataclass(frozen=True, kw_only=True)
class Scored:
    """A model beside the samples it was fitted to and those held out, if any; its scores on either
    are computed when they are asked for.
    """

    label: str
    model: LPVARXModel
    training: FlightRecord
    test: FlightRecord | None
    hold_p: bool

    @cached_property
    def in_sample(self) -> Scores:
        """On the samples it was fitted to."""
        return scores(self.model, self.training, hold_p=self.hold_p)

    @cached_property
    def held_out(self) -> Scores | None:
        """On those held out, if any."""
        return None if self.test is None else scores(self.model, self.test, hold_p=self.hold_p)


@dataclass(frozen=True, kw_only=True)
class AgainstConstant:
    """The models fitted to one record: the scheduled one, the LTI one it is compared with (if both
    exist), then alternative models.

    `hold_p`: one step and 1 s hold p from the start of each prediction, because it is measured.
    `leak`: share of what is new in p that the outputs of the same instant explain; beyond a half
    free runs, which follow p, know what they predict. `trim_note`: why the trim moves in the
    model that is judged, or not.

    Examples
    --------
    >>> import numpy as np, identification as idn, symheli
    >>> u = np.random.default_rng(0).standard_normal(600)
    >>> p = np.sin(0.05 * np.arange(600))
    >>> y = np.zeros(600)
    >>> for k in range(1, 600):
    ...     y[k] = (0.7 + 0.2 * p[k - 1]) * y[k - 1] + u[k - 1]
    >>> units = dict.fromkeys("yup", "1")
    >>> record = symheli.FlightRecord.from_arrays(0.1 * np.arange(600), units, y=y, u=u, p=p)
    >>> arx = idn.LPVARX(
    ...     "y", "u", "p", na=1, nb=1, delay=1, basis=idn.Polynomial(1, -1.0, 1.0))
    >>> [one.label for one in idn.judge.compare_constant(arx, record, None).models]
    ['LPV, degree 1', 'LTI']
    """

    models: tuple[Scored, ...]
    training: FlightRecord
    test: FlightRecord | None
    hold_p: bool = False
    leak: float = 0.0
    trim_note: str = ""

    __repr__ = summarized

    @property
    def scheduled(self) -> LPVARXModel:
        """The first model: the scheduled one where there are two."""
        return next(iter(self.models)).model

    @property
    def judged(self) -> tuple[Scored, ...]:
        """The first model and the LTI one beside it."""
        return self.models[: 1 + (self.scheduled.structure.basis.size > 1)]

    @property
    def low_high(self) -> tuple[float, float]:
        """Range of the scheduling the basis covers."""
        return self.scheduled.structure.basis.ranges[0]

    @property
    def known_from_p(self) -> bool:
        """Whether p contains what a free run has to predict."""
        return self.hold_p and self.leak > MADE_OF_OUTPUTS

    def verdict(self) -> list[str]:
        """The outputs for which scheduling pays and does not, in sentences."""
        if len(self.judged) < 2:
            return []
        if self.test is None:
            return ["nothing was held out: these numbers cannot tell whether scheduling pays"]
        sentences = [self._sentence(str(y)) for y in self.scheduled.outputs]
        rivals = self.models[len(self.judged) :]
        if rivals:
            other = replace(self, models=rivals)
            turned = [
                str(y)
                for y in self.scheduled.outputs
                if self.verdict_on(str(y)) != other.verdict_on(str(y))
            ]
            sentences += [
                f"{rivals[0].label} beside {rivals[1].label} would say otherwise:"
                f" {other._sentence(y)}"
                for y in turned
            ]
        return sentences

    def verdict_on(self, output: str) -> Verdict:
        """The worth of scheduling for this output on held-out data; see `Verdict` and `PAYS`.

        Raises `UnknownNameError` for an output the models do not have, `InputError` where nothing
        was held out, or the structure is itself a constant one.
        """
        ahead, free = (self._differences(output)[h] for h in HORIZONS[1:])
        if free == "better" and ahead != "worse":
            return "pays"
        return "pays for prediction only" if ahead == "better" else "does NOT pay"

    def pays(self, output: str) -> bool:
        """Whether scheduling is better 1 s ahead or in free run on held-out data, and worse in
        neither; see `PAYS`. `verdict_on` says which, and raises the same.
        """
        found = self._differences(output).values()
        return "better" in found and "worse" not in found

    def _differences(self, output: str) -> dict[str, str]:
        """{horizon: better, worse or no different}; free runs that know their answer from p, or
        of no use either way, are no different.
        """
        if output not in self.scheduled.outputs:
            raise UnknownNameError("output", output, map(str, self.scheduled.outputs))
        if len(self.judged) < 2:
            raise InputError(
                "the structure is itself constant; give one with a basis of degree 1 or more"
            )
        lpv, lti = self._fits(output)
        out = {h: difference(lpv[h], lti[h]) for h in HORIZONS[1:]}
        return {**out, HORIZONS[-1]: "not counted"} if self.known_from_p else out

    def _sentence(self, output: str) -> str:
        lpv, lti = self._fits(output)
        found = self._differences(output)
        numbers = (
            f"{_against(lpv[h], lti[h])} {where} ({found[h]})"
            for h, where in zip(HORIZONS[1:], ("1 s ahead", "in free run"), strict=True)
        )
        verdict = self.verdict_on(output)
        return f"{output}: scheduling {verdict} on held-out data: {', '.join(numbers)}"

    def _fits(self, output: str) -> Iterator[dict[str, float]]:
        """{horizon: held-out fit} of the model that is judged and of the LTI one."""
        for one in self.judged:
            if one.held_out is None:
                raise InputError(
                    "nothing was held out: fits in sample cannot show whether scheduling improves"
                    " the model; hold out a part of the record"
                )
            yield {h: fits[output] for h, fits in one.held_out.by_horizon.items()}


def _against(one: float, other: float) -> str:
    """Two fits in percent beside each other."""
    words = percent(one), percent(other)
    if words == (LOST, LOST):
        return "both diverge"
    return (
        f"{words[0]} % against {LOST}" if words[1] == LOST else f"{words[0]} against {words[1]} %"
    )


def difference(one: float, other: float) -> str:
    """What a fit of `one` percent is beside one of `other`, as printed: "better", "worse", "no
    different", or of no use either way.
    """
    if np.isnan(one) or np.isnan(other):
        return "no data to compare"
    if max(one, other) <= 0:
        return "neither better than the mean of the record"
    points = round(one, 1) - round(other, 1)  # one that diverges is infinitely far off
    return (
        "better"
        if round(points, 1) > PAYS
        else "worse"
        if round(points, 1) < -PAYS
        else "no different"
    )


def compare_constant(
    structure: LPVARX,
    training: FlightRecord,
    test: FlightRecord | None,
    *,
    trim: Trim = "still",
    hold_p: bool = False,
    method: Method | str = "ls",
) -> AgainstConstant:
    """Fit a scheduled model and the constant one of the same order, and show where scheduling
    improves the prediction.

    Scheduling pays for an output where the scheduled model is more than one point better in free
    run on held-out data and no worse 1 s ahead; it pays for prediction only where it is better 1 s
    ahead alone.

    Parameters
    ----------
    structure : LPVARX
        The scheduled structure; a constant one is fitted alone.
    training : FlightRecord
        What both are fitted to.
    test : FlightRecord or None
        What both are judged on; without it there is no verdict.
    trim : {"still", "moving", "auto"}
        Whether the models have d(p) times the change of p (`offset_rate`). "auto" fits both once
        more with it where p moves and is not made of the outputs, and judges those that predict 1 s
        better in sample, or, where that is the same, run free better.
    hold_p : bool
        Predictions hold p from their start, as where it is measured.
    method : Method or str
        As `fit` takes it.

    Returns
    -------
    AgainstConstant
        The models with their scores, `verdict_on(output)` and the `verdict()` in sentences.

    Raises
    ------
    InputError, ExcitationError
        As `fit` does.

    Examples
    --------
    >>> import numpy as np, identification as idn, symheli
    >>> u = np.random.default_rng(0).standard_normal(600)
    >>> p = np.sin(0.05 * np.arange(600))
    >>> y = np.zeros(600)
    >>> for k in range(1, 600):
    ...     y[k] = (0.7 + 0.2 * p[k - 1]) * y[k - 1] + u[k - 1]
    >>> units = dict.fromkeys("yup", "1")
    >>> record = symheli.FlightRecord.from_arrays(0.1 * np.arange(600), units, y=y, u=u, p=p)
    >>> arx = idn.LPVARX(
    ...     "y", "u", "p", na=1, nb=1, delay=1, basis=idn.Polynomial(1, -1.0, 1.0))
    >>> idn.judge.compare_constant(arx, *record.split(0.7)).verdict_on("y")
    'pays'
    """

    def pair(moving: bool) -> list[Scored]:
        arx = replace(structure, offset_rate=moving)
        suffix = ", moving trim" if moving else ""
        structures = (
            {f"LPV, degree {arx.basis.size - 1}{suffix}": arx} if arx.basis.size > 1 else {}
        )
        structures[f"LTI{suffix}"] = arx.lti()
        found = []
        for label, one in tracked(f"models{suffix}", structures.items(), len(structures)):
            model = fit(one, training, method)
            found.append(
                Scored(label=label, model=model, training=training, test=test, hold_p=hold_p)
            )
        return found

    leak = float(np.max(share_from_outputs(structure, training)))
    first, note = pair(trim == "moving"), ""
    if trim == "auto" and structure.basis.size > 1:
        if leak > MADE_OF_OUTPUTS:
            verdict = (
                f"{100 * leak:.0f} % of what is new in {structure.scheduling} is in the outputs of"
                " the same instant"
            )
            note = f"offset_rate is not tried: {verdict}"
        else:
            try:
                second = pair(True)
            except (ExcitationError, InputError) as error:
                note = f"offset_rate is not tried: {error}"
            else:
                without, with_it = (_mean_fits(models[0].in_sample) for models in (first, second))
                first, second = (second, first) if with_it > without else (first, second)
                numbers = (
                    f"{_mean(one)} 1 s ahead and {_mean(free)} in free run {how}"
                    for (one, free), how in ((with_it, "with it"), (without, "without"))
                )
                note = (
                    f"offset_rate, the moving trim, in sample: {', '.join(numbers)} (means of the"
                    f" outputs, none below {LEAST:g}); judged is the model"
                    f" {'with' if with_it > without else 'without'}"
                )
                first = [*first, *second]
    return AgainstConstant(
        models=tuple(first),
        training=training,
        test=test,
        hold_p=hold_p,
        leak=leak,
        trim_note=note,
    )


def _mean(fit: float) -> str:
    return f"{fit:.1f} %" if fit > LEAST else "useless"


def _mean_fits(found: Scores) -> tuple[float, float]:
    """Means over the outputs of the fits 1 s ahead and in free run, as printed; the first decides,
    the second where it is the same.
    """
    one, free = (
        round(float(np.mean([max(v, LEAST) for v in fits.values()])), 1)
        for fits in (found.ahead, found.free_run)
    )
    return one, free
