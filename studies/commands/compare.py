"""symheli compare: scheduled models beside constant ones, on flights in wind and noise."""

from __future__ import annotations

import argparse

from studies.commands.arguments import option
from studies.commands.options import ON_A_RUNNER, count, kept_on_a_runner, vehicle
from studies.output import Output

HELP = (
    "compare scheduled with constant models (LPV beside LTI) on transitions in wind and noise, two"
    " inputs and all inputs: where scheduling pays"
)

ARGUMENTS = (
    *vehicle(),
    option("--seeds", "N", "seeds beside the default one", count, 20),
    *ON_A_RUNNER,
)
kept = kept_on_a_runner


def run(arguments: argparse.Namespace) -> Output:
    """Simulate, fit and validate, showing progress."""
    from studies.campaigns import pays
    from studies.campaigns.runners import runner

    with runner(arguments.workers, arguments.scheduler) as on:
        lines = list(
            pays.where_scheduling_pays(
                arguments.seeds, arguments.vehicle, on=on, path=arguments.out
            )
        )
    return Output(pays.table(lines), {"lines": pays.data(lines)})
