"""What is fuzzed how often, and what is not and why."""

from __future__ import annotations

from valid_calls import exported

ERRORS = "raised or warned with, not called"
PROTOCOL = "a protocol: nothing to call"
CHOICE = "a choice of the package: its values are listed"
ARITHMETIC = "computes with what it is given, NaN too; what comes in is checked by its users"
CONTEXT = "a context manager, entered by contextlib and not by the example; its check has a test"
BY_ITS_USERS = "a tuple of what it is given; checked by what it is given to"
RESULT = "made by the package alone, from what it has checked: see the entry that returns it"

EXEMPT: dict[str, str] = {
    **{
        name: ERRORS
        for name, thing in exported()
        if isinstance(thing, type) and issubclass(thing, Exception)
    },
    **dict.fromkeys(
        (
            *("symheli.PureController", "symheli.StatefulController"),
            *("identification.FlightSource", "identification.InstrumentSource"),
            "identification.Method",
        ),
        PROTOCOL,
    ),
    **dict.fromkeys(
        (*("synthesis.Status", "synthesis.DesignStatus", "identification.Variable"),),
        CHOICE,
    ),
    **{
        f"symheli.{name}": RESULT
        for name in (
            *("Air", "Autopilot", "Helicopter"),
            *(
                "TrimPoint",
                "FlightDataset",
            ),
        )
    },
    **{
        f"identification.{name}": RESULT
        for name in (
            "StateSpaceModel",
            *("AgainstConstant", "Coefficients"),
            *(
                "Criterion",
                "Estimate",
            ),
            *(
                "Experiment",
                "FitForControl",
                "FrozenModels",
            ),
            *("History", "KinematicModel", "LPVARXModel"),
            *(
                "Online",
                "Plan",
            ),
            *(
                "RigidBodyOnline",
                "Scores",
            ),
        )
    },
    **{
        f"synthesis.{name}": RESULT
        for name in (
            *("Certificate", "Controller", "DwellTime", "SwitchedController"),
            *(
                "Estimator",
                "GainCurve",
                "MarginTable",
                "Margins",
                "RobustMargin",
                "WorstCaseGain",
                "LoopShaping",
                "MuDesign",
                "SlopeMargin",
                "SpecificationTable",
                "StructuredController",
                "Tube",
                "Coverage",
                "LocalGain",
                "InvariantSet",
                "LowComplexitySet",
                "Governor",
            ),
        )
    },
    "synthesis.DynamicBlock": BY_ITS_USERS,
    "synthesis.PolynomialMatrix": ARITHMETIC,
    "symheli.watched": CONTEXT,
}
"""Public callables whose making is not fuzzed; their methods are, where an example calls them."""

USUAL = 60
FEW = 12
SLOW = {
    *("symheli.sweep", "symheli.sweep_grid", "symheli.fly", "symheli.fly_batch"),
    *("symheli.fly_campaign", "symheli.trim_map", "symheli.gain_scheduled_lqr"),
    *("identification.fit_for_control", "identification.order_scan", "identification.design_model"),
    *("identification.unseen_flight", "identification.KinematicModel.observer"),
    *("synthesis.l2_gain", "synthesis.output_feedback", "synthesis.Controller.certify"),
    *("synthesis.Controller.discretize", "synthesis.estimator", "synthesis.Estimator.certify"),
    *("synthesis.certify_sampled", "synthesis.lft_feedback", "synthesis.multiobjective"),
    *("synthesis.proven_around", "synthesis.state_feedback", "synthesis.with_wrong_parameter"),
    *(
        "synthesis.frozen_box_gain",
        "synthesis.generalized_h2",
        "synthesis.h2_gain",
        "synthesis.decay_rate",
    ),
    *("synthesis.stability", "synthesis.lower_bound", "synthesis.lft_gain"),
    *("synthesis.lqr", "synthesis.lqg", "synthesis.switched", "synthesis.dwell_time"),
    *("synthesis.SwitchedController.certify", "synthesis.Controller.of"),
    *("synthesis.Certificate.verify", "synthesis.lft_stability", "synthesis.structured"),
    *(
        "synthesis.bounded_truncation",
        "synthesis.robust_margin",
        "synthesis.worst_case_gain",
        "synthesis.mu_synthesis",
        "synthesis.loop_shaping",
        "synthesis.invariant_set",
        "synthesis.low_complexity_set",
        "synthesis.SwitchInside",
        "synthesis.governor",
    ),
}
"""Entries that fly, sweep or solve: `FEW` inputs each."""
LARGER = {"synthesis.multiobjective", "synthesis.output_feedback", "synthesis.lft_feedback"}
"""Where a larger count is a larger problem, that takes its time: not asked."""


def asked(entry: str) -> bool:
    """Whether it is fuzzed: methods of results are, those of mere arithmetic are not."""
    owner = ".".join(entry.split(".")[:2])
    return entry not in EXEMPT and EXEMPT.get(owner) != ARITHMETIC


def inputs(entry: str) -> int:
    """How many changed calls of the entry make up the whole."""
    return FEW if entry in SLOW else USUAL
