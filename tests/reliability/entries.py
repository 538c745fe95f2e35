"""What is fuzzed how often, what is not and why, and where NaN is an answer."""

from __future__ import annotations

from valid_calls import exported

ERRORS = "raised or warned with, not called"
PROTOCOL = "a protocol: nothing to call"
CHOICE = "a choice of the package: its values are listed"
RESULT = "made by the package alone, from what it has checked: see the entry that returns it"

EXEMPT: dict[str, str] = {
    **{
        name: ERRORS
        for name, thing in exported()
        if isinstance(thing, type) and issubclass(thing, Exception)
    },
    **dict.fromkeys(
        (
            *("symheli.Controller", "identification.FlightSource"),
            *("identification.InstrumentSource", "identification.Method"),
        ),
        PROTOCOL,
    ),
    **dict.fromkeys(
        (
            *("identification.Forgetting", "synthesis.Status", "synthesis.DesignStatus"),
            "identification.Variable",
        ),
        CHOICE,
    ),
    **{
        f"symheli.{name}": RESULT
        for name in (
            *("Air", "Autopilot", "Batch", "DerivativeTable", "FlightBatch", "Helicopter"),
            *("Trajectory", "TrimBatch", "TrimMap", "TrimPoint", "FlightDataset"),
        )
    },
    **{
        f"identification.{name}": RESULT
        for name in (
            *("AgainstConstant", "Band", "BesideBaseline", "CoefficientValues", "Coefficients"),
            *("Criterion", "DependenceReport", "Entry", "Estimate", "ExcitationReport"),
            *("Experiment", "FitForControl", "FrequencyResponse", "FrozenModels", "Group"),
            *("History", "KinematicModel", "KinematicObserver", "LPVARXModel"),
            *("MatrixEllipsoid", "Online", "OrderScan", "Plan", "RLSInfo", "RLSState"),
            *("ResidualAnalysis", "ResponseBand", "RigidBodyOnline", "Scores", "SlowMode"),
            *("SlowModes", "Term", "Theil", "Trial", "Uncertainty", "UnseenFlight"),
        )
    },
    **{
        f"synthesis.{name}": RESULT
        for name in (
            *("Attempt", "Bandwidth", "BoxGain", "BoxLyapunov", "Certificate", "Controller"),
            *("Estimator", "Flown", "FrozenGain", "Generalized", "LowerBound", "Margins"),
            *("MemoryLyapunov", "Multiplier", "PointDesign", "Proof", "Seconds"),
            *("SplineLyapunov", "Trajectory"),
        )
    },
}
"""Public callables whose making is not fuzzed; their methods are, where an example calls them."""

NAN_IS_SAID: dict[str, tuple[str, ...]] = {}
"""Where a result may hold NaN, by entry and the start of the place, as its documentation says."""
