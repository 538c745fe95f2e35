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

RESULTS = set(
    """
    AgainstConstant Air Autopilot Certificate Coefficients
    Controller Coverage Criterion DwellTime Estimate ListedBound ListedFeedback
    Estimator Experiment FitForControl FlightDataset FrozenModels
    GainCurve ReferenceGovernor Helicopter History InvariantSet
    KinematicModel LPVARXModel LargestGust LocalGain LoopShaping LowComplexitySet
    MarginTable Margins MuDesign Online PeriodicGain Plan RationalGain ReachableTube
    RegionOfAttraction
    RigidBodyOnline RobustMargin Scores SlopeMargin SpecificationTable
    ProvenClaim StateSpaceModel StructuredController SwitchedController TerminalSet TrimPoint Tube
    Verdict WorstCaseGain
    """.split()
)

EXEMPT: dict[str, str] = {
    **{
        name: ERRORS
        for name, thing in exported()
        if isinstance(thing, type) and issubclass(thing, Exception)
    },
    **dict.fromkeys(
        (
            *("symheli.flight.PureController", "symheli.flight.StatefulController"),
            *("identification.methods.FlightSource", "identification.methods.InstrumentSource"),
            "identification.methods.Method",
        ),
        PROTOCOL,
    ),
    **dict.fromkeys(
        (
            *(
                "synthesis.analysis.Status",
                "synthesis.designs.DesignStatus",
                "identification.forgetting.Variable",
            ),
        ),
        CHOICE,
    ),
    **{name: RESULT for name, _ in exported() if name.rpartition(".")[2] in RESULTS},
    "synthesis.robust.DynamicBlock": BY_ITS_USERS,
    "synthesis.analysis.PolynomialMatrix": ARITHMETIC,
    "symheli.progress.watched": CONTEXT,
}
"""Public callables whose making is not fuzzed; their methods are, where an example calls them."""

USUAL = 60
FEW = 12
SLOW = {
    *("symheli.sweep", "symheli.steady.sweep_grid", "symheli.fly", "symheli.flight.fly_batch"),
    *("symheli.flight.fly_campaign", "symheli.trim_map", "symheli.flight.gain_scheduled_lqr"),
    *(
        "identification.fit_for_control",
        "identification.order_scan",
        "identification.design.design_model",
    ),
    *("identification.judge.validate", "identification.model.KinematicModel.observer"),
    *("synthesis.l2_gain", "synthesis.output_feedback", "synthesis.Controller.certify"),
    *(
        "synthesis.Controller.discretize",
        "synthesis.estimator",
        "synthesis.design.lpv.estimator.Estimator.certify",
    ),
    *("synthesis.certify_sampled", "synthesis.designs.lft_feedback", "synthesis.multiobjective"),
    *(
        "synthesis.analysis.proven_around",
        "synthesis.state_feedback",
        "synthesis.analysis.with_scheduling_error",
    ),
    *(
        "synthesis.analysis.frozen_box_gain",
        "synthesis.analysis.energy_to_peak",
        "synthesis.h2_gain",
        "synthesis.decay_rate",
    ),
    *("synthesis.stability", "synthesis.lower_bound", "synthesis.lft_gain"),
    *(
        "synthesis.lqr",
        "synthesis.lqg",
        "synthesis.switching.switched",
        "synthesis.switching.dwell_time",
    ),
    *("synthesis.switching.SwitchedController.certify", "synthesis.Controller.of"),
    *("synthesis.Certificate.verify", "synthesis.analysis.lft_stability", "synthesis.structured"),
    *(
        "synthesis.designs.bounded_truncation",
        "synthesis.robust.robust_margin",
        "synthesis.robust.worst_case_gain",
        "synthesis.robust.mu_synthesis",
        "synthesis.designs.loop_shaping",
        "synthesis.sets.invariant_set",
        "synthesis.sets.low_complexity_set",
        "synthesis.sets.SwitchInside",
        "synthesis.sets.reference_governor",
    ),
}
"""Entries that fly, sweep or solve: `FEW` inputs each."""
LARGER = {"synthesis.multiobjective", "synthesis.output_feedback", "synthesis.designs.lft_feedback"}
"""Where a larger count is a larger problem, that takes its time: not asked."""


def asked(entry: str) -> bool:
    """Whether it is fuzzed: methods of results are, those of mere arithmetic are not."""
    owner = ".".join(entry.split(".")[:2])
    return entry not in EXEMPT and EXEMPT.get(owner) != ARITHMETIC


def inputs(entry: str) -> int:
    """How many changed calls of the entry make up the whole."""
    return FEW if entry in SLOW else USUAL
