"""A model that is not fit for control carries no design, unless one insists."""

from __future__ import annotations

import numpy as np
import pytest

import identification as idn
from symheli.errors import InputError, NotFitError


def judged(*verdicts):
    rows = tuple(
        idn.judge.Criterion(name=f"row {i}", value=1.4, threshold=1.0, verdict=v, source="here")
        for i, v in enumerate(verdicts)
    )
    nothing = np.array([np.nan])
    return idn.judge.fit_for_control.FitForControl(
        criteria=rows, points=(0.0,), margin=nothing, gap=nothing, second_gap=nothing
    )


class Spy:
    """What is asked of a model."""

    def to_state_space(self, *given, **options):
        return "estimate", given, options

    def uncertain(self, probability, *given, **options):
        return "set", probability


def test_a_fit_model_is_handed_out_as_its_estimate_or_its_set():
    assert idn.design.design_model(Spy(), judged("fit"), outputs=["r"])[:2] == (
        "estimate",
        (["r"], None),
    )
    assert idn.design.design_model(Spy(), judged("fit"), probability=0.9) == ("set", 0.9)


@pytest.mark.parametrize(
    ("verdict", "printed"), [("not fit", "violated"), ("not known", "not known")]
)
def test_any_other_is_refused_with_every_criterion_that_decides(verdict, printed):
    with pytest.raises(NotFitError, match="force=True") as caught:
        idn.design.design_model(Spy(), judged("fit", verdict))
    assert caught.value.reasons == (f"row 1 is 1.4, at most 1: {printed}",)
    assert idn.design.design_model(Spy(), judged(verdict), force=True)[0] == "estimate"


def test_what_was_not_judged_is_said():
    with pytest.raises(InputError, match="fit_for_control"):
        idn.design.design_model(Spy(), "fit")
