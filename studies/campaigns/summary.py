"""A campaign in a table: medians by point of the grid."""

from __future__ import annotations

from typing import Any

import numpy as np

from studies.campaigns.campaign import Campaign
from studies.campaigns.dataset import CampaignDataset
from studies.campaigns.trial import SECONDS
from studies.output import columns

MAX_QUANTITIES = 6
"""Largest number of quantities shown by default."""
MAX_POINTS = 40
"""Largest number of grid points shown."""


def table(campaign: Campaign, dataset: CampaignDataset, show: list[str] | None = None) -> str:
    """A line a point of the grid: cases that did not fail, then the median of each quantity over
    them; below it why cases failed.

    `show` names the quantities; default the first that any case has. Raises `InputError` for one
    that is not there.
    """
    rows = dataset.rows_of(campaign.cases)
    values = {name: dataset[name][rows] for name in show or dataset.units}
    shown = [n for n, v in values.items() if n in (show or ()) or np.isfinite(v).any()]
    shown = shown if show else [n for n in shown if n != SECONDS][:MAX_QUANTITIES]
    reasons = {row: reason for row, reason in dataset.reasons.items() if row in set(rows)}
    points: dict[tuple[Any, ...], list[int]] = {}
    for i, case in enumerate(campaign.cases):
        points.setdefault(tuple(case.parameters[n] for n in campaign.grid), []).append(i)
    units = [dataset.units.get(name, "") for name in shown]
    lines = [[*campaign.grid, "cases", *shown], [*([""] * len(campaign.grid)), "", *units]]
    for point, at in list(points.items())[:MAX_POINTS]:
        good = [i for i in at if rows[i] not in reasons]
        medians = [f"{_median(values[n][good]):.5g}" for n in shown]
        lines.append([*map(str, point), f"{len(good)}/{len(at)}", *medians])
    out = [
        f"{campaign.trial.name}: medians of {len(rows)} cases, {len(reasons)} failed",
        columns(lines, left=len(campaign.grid)),
    ]
    if len(points) > MAX_POINTS:
        out.append(f"... and {len(points) - MAX_POINTS} points more")
    out += [f"failed: {n} x {why}" for why, n in _counted(reasons).items()]
    return "\n".join([*out, f"every case: {dataset.path}"])


def data(campaign: Campaign, dataset: CampaignDataset) -> dict[str, Any]:
    """Every case with its parameters and quantities."""
    values, reasons = dataset.values, dataset.reasons
    return {
        "trial": campaign.trial.name,
        "dataset": str(dataset.path),
        "units": dataset.units,
        "failed": sum(row in reasons for row in dataset.rows_of(campaign.cases)),
        "cases": [
            {
                "parameters": case.parameters,
                "quantities": dict(zip(dataset.units, values[row], strict=True)),
                "reason": reasons.get(row),
            }
            for case, row in zip(campaign.cases, dataset.rows_of(campaign.cases), strict=True)
        ],
    }


def _median(values: np.ndarray) -> float:
    there = values[~np.isnan(values)]
    return float(np.median(there)) if there.size else float("nan")


def _counted(reasons: dict[int, str]) -> dict[str, int]:
    return {why: list(reasons.values()).count(why) for why in dict.fromkeys(reasons.values())}
