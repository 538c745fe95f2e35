"""Execution of a campaign: cases that are missing in its dataset are computed, and stored one by
one.
"""

from __future__ import annotations

import math
import os
import warnings
from collections.abc import Iterator, Mapping, Sequence
from concurrent.futures import CancelledError, Future
from contextlib import closing
from importlib.metadata import version
from pathlib import Path

import numpy as np

from studies.campaigns.campaign import Campaign
from studies.campaigns.dataset import CampaignDataset
from studies.campaigns.runners import Runner, answers
from studies.campaigns.trial import Trial, TrialOutcome, Value, reason_of
from studies.setup.stored_stages import code_digest
from symheli.errors import DataWarning, SymheliError
from symheli.progress import task
from symheli.values.arrays import Array


def run(
    campaign: Campaign,
    path: str | os.PathLike[str],
    on: Runner,
    *,
    again: bool = False,
) -> CampaignDataset:
    """Compute the cases that the dataset at `path` does not have yet.

    Called again after a stop or a kill, or with more values or draws, it computes what is missing;
    the numbers do not depend on the runner. A case that fails is kept with its reason.

    Parameters
    ----------
    campaign : Campaign
        The cases.
    path : str or path
        Folder of the dataset, by habit named *.zarr; made where it is not there.
    on : Runner
        Where cases run (`runner()`).
    again : bool
        Compute the cases that failed once more.

    Returns
    -------
    CampaignDataset
        With every case of the campaign, and those that earlier campaigns left there.

    Raises
    ------
    InputError
        The folder holds something else, or a case cannot be handed to a worker.
    SymheliError
        The disk is full or the folder cannot be written, or the scheduler is gone; what is finished
        stays.

    Examples
    --------
    >>> import tempfile, pathlib
    >>> folder = pathlib.Path(tempfile.mkdtemp()) / "pendulums.zarr"
    >>> def pendulum(*, length: float = 1.0, seed: int = 0) -> dict[str, float]:
    ...     rng = np.random.default_rng(seed)
    ...     return {"period": 2 * np.pi * np.sqrt(length / rng.normal(9.81, 0.01))}
    >>> campaign = Campaign(Trial(pendulum, {"period": "s"}), grid={"length": [0.5, 1.0]})
    >>> with Here() as here:
    ...     dataset = run(campaign, folder, here)
    >>> dataset["period"].round(2).tolist(), dataset["length"].tolist()
    ([1.42, 2.01], [0.5, 1.0])
    """
    code = code_digest()[:16]
    about = {"version": version("symheli"), "code": code}
    dataset = CampaignDataset.open(Path(path), campaign, about)
    rows = dataset.rows_of(campaign.cases)
    finished, failed = dataset.finished, dataset.reasons
    missing = [r for r in rows if not finished[r] or (again and r in failed)]
    if finished.any() and dataset.attributes.get("code") != code:
        warnings.warn(
            f"{path}: {int(finished.sum())} cases there were computed by other code than the"
            " present one; remove the folder to have all from one",
            DataWarning,
            stacklevel=2,
        )
    cases = [dataset.cases[row].parameters for row in missing]
    for i, outcome in outcomes(campaign.trial, cases, on):
        dataset.write(missing[i], outcome)
    return dataset


def columns_of(campaign: Campaign, on: Runner, path: Path | None = None) -> dict[str, Array]:
    """Return every quantity over the cases of the campaign, in their order (N,); with a `path`
    stored there as by `run`.

    Raises `SymheliError` where a case has failed, when the others are done.
    """
    if path is not None:
        dataset = run(campaign, path, on)
        rows, reasons = dataset.rows_of(campaign.cases), dataset.reasons
        values = dataset.values[rows]
        failed = {i: reasons[row] for i, row in enumerate(rows) if row in reasons}
    else:
        values = np.full((len(campaign.cases), len(campaign.trial.units)), np.nan)
        failed = {}
        for i, one in outcomes(campaign.trial, [c.parameters for c in campaign.cases], on):
            values[i] = one.values
            if one.reason:
                failed[i] = one.reason
    if failed:
        first = min(failed)
        raise SymheliError(
            f"{len(failed)} of {len(campaign.cases)} cases failed; the first,"
            f" {dict(campaign.cases[first].parameters)}: {failed[first]}"
        )
    return dict(zip(campaign.trial.units, values.T, strict=True))


def outcomes(
    trial: Trial, cases: Sequence[Mapping[str, Value]], on: Runner
) -> Iterator[tuple[int, TrialOutcome]]:
    """Yield number and outcome of each case as they are done. A case fails if its processes end as
    often as the runner tries.

    Raises `SymheliError` where the runner is gone, or cannot hand a case to a worker.
    """
    failed = 0
    with task(f"cases of {trial.name}", len(cases)) as shown:
        for i, outcome in _outcomes(trial, cases, on):
            failed += bool(outcome.reason)
            shown.step(f"{failed} failed" if failed else "")
            yield i, outcome


def _outcomes(
    trial: Trial, cases: Sequence[Mapping[str, Value]], on: Runner
) -> Iterator[tuple[int, TrialOutcome]]:
    todo = list(range(len(cases)))
    for attempt in range(on.tries):
        lost = []
        calls = [trial.call(cases[i]) for i in todo]
        with closing(answers(on, calls)) as found:
            for at, future in found:
                i, error = todo[at], _error(future)
                if error is None:
                    yield i, future.result()
                elif not on.lost(error):
                    raise _unable(trial, error) from error
                elif attempt + 1 < on.tries:
                    lost.append(i)
                else:
                    nothing = (math.nan,) * len(trial.units)
                    yield i, TrialOutcome(nothing, reason_of(error))
        todo = lost


def _error(future: Future[TrialOutcome]) -> BaseException | None:
    try:
        return future.exception()
    except CancelledError as error:
        return error


def _unable(trial: Trial, error: BaseException) -> SymheliError:
    if isinstance(error, CancelledError):
        return SymheliError(
            "the scheduler has stopped, or has dropped a case; finished cases are kept: run the"
            " campaign again"
        )
    return SymheliError(
        f"a worker cannot run {trial.name} ({reason_of(error)}): it needs this project, and what"
        " defines the trial, in the same version"
    )
