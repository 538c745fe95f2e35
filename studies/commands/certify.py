"""Command symheli certify: a proven gain of the lateral loop while the airspeed changes at a
bounded rate.
"""

from __future__ import annotations

import argparse
import math
from dataclasses import replace
from typing import TYPE_CHECKING

from studies.commands import given_model, options
from studies.commands.arguments import flag, option, several
from studies.output import Output, progress
from symheli.errors import InputError

if TYPE_CHECKING:
    from symheli import LPVStateSpace
    from synthesis import Certificate
    from synthesis.certify.statement.forms import LyapunovForm

HELP = "proven gain and stability of the lateral loop, or of any model, for a rate of airspeed"

ARGUMENTS = (
    *options.HELICOPTER,
    option(
        "--rate",
        "M/S^2",
        "largest |dV/dt|, m/s^2 (of --model: of its parameter), or inf",
        options.rate,
        3.0,
    ),
    several(
        "--airspeeds",
        ("LOW", "HIGH"),
        "range, m/s (default: 0 13; of --model its own)",
        type=options.number,
    ),
    option(
        "--channel",
        ("gust", "inputs"),
        "lateral gust (default), or disturbances at the inputs, -> r, phi",
    ),
    *given_model.ARGUMENTS,
    option(
        "--lft",
        "TEST",
        "use a classical LFT test instead: small gain, D, DG or full block; --rate is ignored",
    ),
    option(
        "--memory",
        "S",
        "let P depend also on the airspeed filtered by a first-order lag of S seconds",
        options.positive,
    ),
    several(
        "--across",
        ("L", "D"),
        "segments and degree of P in the lag error (default: 3 2)",
        type=options.at_least_one,
    ),
    option(
        "--order",
        "M",
        "use a V of degree 2M in the states, for --stability",
        options.at_least_one,
        1,
    ),
    option(
        "--segments",
        "K",
        "segments of P in airspeed, tried in turn",
        options.at_least_one,
        nargs="+",
    ),
    option(
        "--grading", "G", "knots at (k/K)^G of the range (2; with a memory 1.5)", options.positive
    ),
    flag("--stability", "prove stability only, no gain"),
    option("--save", "FILE", "save the certificate to FILE; symheli verify FILE verifies it again"),
    flag("--rigorous", "verify once more in exact rational arithmetic"),
)


def run(arguments: argparse.Namespace) -> Output:
    """Build the loop, prove, verify; exit status 1 where nothing could be proven."""
    import synthesis

    loop, head = _given(arguments) if arguments.model else _lateral(arguments)
    cert: Certificate
    if arguments.lft:
        _refuse_form(arguments)
        progress(f"LFT test with {arguments.lft} for a parameter that may jump")
        test = synthesis.analysis.lft_stability if arguments.stability else synthesis.lft_gain
        from studies.setup.bounds import COPIES, LEFT_OUT

        cert, rate = test(loop.to_lft().reduce(COPIES), arguments.lft), math.inf
        cert = cert.resting_on((LEFT_OUT,))
    else:
        progress(f"searching a Lyapunov function for |dp/dt| <= {arguments.rate:g} per second")
        certify = synthesis.stability if arguments.stability else synthesis.l2_gain
        cert, rate = (
            certify(loop, rate=arguments.rate, form=_form(arguments)),
            arguments.rate,
        )
    exact = None
    if arguments.rigorous:
        progress("verifying in rational arithmetic")
        exact = cert.verify(rigorous=True)
    if arguments.save:
        cert.save(arguments.save)
    text = f"{head}\n{cert.details}" + (
        "" if exact is None else f"\n  exact verification: {'passed' if exact else 'not passed'}"
    )
    data = {
        "loop": head,
        "kind": cert.kind,
        "rate": rate,
        "lft": arguments.lft,
        "gamma": cert.gamma,
        "lower": cert.lower,
        "frozen": cert.frozen,
        "status": cert.status.name,
        "verified": cert.verified,
        "exact": exact,
        "hypotheses": cert.hypotheses,
        "solver": cert.solver,
        "seconds": cert.seconds._asdict(),
        "proof": arguments.save,
    }
    return Output(text, data, status=0 if cert.verified and exact is not False else 1)


def _lateral(arguments: argparse.Namespace) -> tuple[LPVStateSpace, str]:
    """The lateral loop of --vehicle, and what it is."""
    from studies.loops.lateral import ATTITUDE_HOLD, lateral_loop

    given_model.only_with_a_model(arguments)
    (low, high), channel = arguments.airspeeds or (0.0, 13.0), arguments.channel or "gust"
    gains = dict(arguments.feedback) or ATTITUDE_HOLD
    progress(f"trimming and linearizing {arguments.vehicle} from {low:g} to {high:g} m/s")
    heli, degree = options.helicopter(arguments), arguments.degree
    loop = lateral_loop(heli, low, high, channel, degree, gains=gains)
    return loop, (
        f"lateral loop of {arguments.vehicle}, {given_model.words(gains)}, {low:g} to {high:g} m/s,"
        f" {channel} -> r, phi (SI)"
    )


def _given(arguments: argparse.Namespace) -> tuple[LPVStateSpace, str]:
    """The loop of --model, and what it is."""
    options.refuse(arguments, options.OF_A_VEHICLE, "on a model from a file, --model")
    if arguments.channel:
        raise InputError(
            "--channel selects a channel of a vehicle's lateral loop; for a model give --inputs and"
            " --outputs"
        )
    loop = given_model.closed_loop(arguments, given_model.lpv_model(arguments))
    if arguments.airspeeds:
        low, high = arguments.airspeeds
        loop = loop.with_scheduling(replace(loop.scheduling, low=low, high=high))
    ranges = ", ".join(f"{s.name} {s.low:g} to {s.high:g} {s.unit}" for s in loop.parameters)
    return loop, (
        f"{arguments.model}, {given_model.words(dict(arguments.feedback))}, {ranges},"
        f" {', '.join(loop.inputs)} -> {', '.join(loop.outputs)} (SI)"
    )


def _refuse_form(arguments: argparse.Namespace) -> None:
    given = ("memory", "across", "segments", "grading")
    options.refuse(arguments, ["rate"], "on an LFT test, --lft, where the parameter may jump")
    names = [name for name in given if getattr(arguments, name)]
    names += ["order"] if arguments.order > 1 else []
    if names:
        raise InputError(
            f"an LFT test has a constant P: leave out --{', --'.join(names)}, or leave out --lft"
        )


def _form(arguments: argparse.Namespace) -> LyapunovForm:
    """Raises `InputError` for options that do not go together."""
    from synthesis.forms import HigherOrder, LaggedParameter, Spline

    if arguments.memory and arguments.order > 1:
        raise InputError("give --memory or --order, not both: they are different forms of V")
    if arguments.across and not arguments.memory:
        raise InputError("--across sets how P depends on the lag error; give --memory S with it")
    segments = tuple(arguments.segments) if arguments.segments else None
    if arguments.memory:
        across, degree = arguments.across or (3, 2)
        return LaggedParameter(
            arguments.memory,
            segments=segments,
            grading=arguments.grading or 1.5,
            across_segments=across,
            across_degree=degree,
        )
    if arguments.order > 1:
        return HigherOrder(arguments.order, segments=segments, grading=arguments.grading)
    return Spline(segments=segments, grading=arguments.grading)
