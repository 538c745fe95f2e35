"""Results of the cases of a campaign, as one dataset on disk in the Zarr format."""

from __future__ import annotations

import hashlib
import json
import os
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from studies.campaigns.campaign import Campaign, Case
from studies.campaigns.trial import LONGEST_REASON, TrialOutcome, Value
from symheli.errors import InputError, UnknownNameError
from symheli.extras import extra
from symheli.values.arrays import Array
from symheli.values.whole_files import write_text
from symheli.values.zarr_folder import ZarrArray, ZarrFolder

if TYPE_CHECKING:
    import pandas
    import xarray

CASES = "cases.json"
"""Parameters of every case, in order: what the arrays are made from."""


@dataclass(frozen=True, eq=False)
class CampaignDataset:
    """Cases in a folder: `values` (case, quantity), NaN where a case is not there or failed, with
    `quantity`, `unit`, every parameter (case), and `reason` (case), empty where a case did not
    fail. The quantity `seconds` is there of every case that is finished.

    A case is one file, whole or not there, so that a reader may come at any time; also
    `xarray.open_zarr(path)["values"].to_dataset("quantity")`.

    Raises `InputError` where there is no such dataset.
    """

    path: Path
    attributes: Mapping[str, Any] = field(init=False, repr=False)
    """Trial, version and digest of the code."""
    cases: tuple[Case, ...] = field(init=False, repr=False)
    _folder: ZarrFolder = field(init=False, repr=False)

    def __post_init__(self) -> None:
        object.__setattr__(self, "path", Path(self.path))
        object.__setattr__(self, "_folder", ZarrFolder(self.path, remade=True))
        try:
            content = json.loads((self.path / CASES).read_text(encoding="utf-8"))
            digest = content.pop("digest", None)
            object.__setattr__(self, "attributes", content["attributes"])
            object.__setattr__(self, "cases", tuple(map(Case, content["cases"])))
        except (OSError, ValueError, LookupError, TypeError, AttributeError) as error:
            raise InputError(f"{self.path}: not a dataset of a campaign ({error})") from error
        if digest != _digest(content):
            raise InputError(
                f"{self.path / CASES} does not match its digest: it was damaged or edited, or an"
                " older version wrote it; take an older copy, or remove the folder"
            )

    @classmethod
    def open(
        cls, path: str | os.PathLike[str], campaign: Campaign, about: Mapping[str, Any]
    ) -> CampaignDataset:
        """Open the dataset for `campaign`: a new one with the attributes `about`, or an existing
        one, to which the missing cases are appended.

        Raises `InputError` if the folder holds something else or rows of other trials, and
        `SymheliError` if it cannot be written.
        """
        folder, units = Path(path), campaign.trial.units
        if (folder / CASES).is_file():
            there = cls(folder)
            there._refuse(campaign)
            known = {case.key for case in there.cases}
            new = [case for case in campaign.cases if case.key not in known]
            cases, about = (*there.cases, *new), there.attributes
        elif folder.is_file() or (folder.is_dir() and any(folder.iterdir())):
            raise InputError(f"{folder} exists and does not hold a campaign; give another folder")
        else:
            cases = campaign.cases
            about = {**about, "trial": campaign.trial.name, "units": units}
        content = {"attributes": about, "cases": [case.parameters for case in cases]}
        write_text(folder / CASES, json.dumps({**content, "digest": _digest(content)}))
        dataset = cls(folder)
        dataset._describe()
        return dataset

    def write(self, row: int, outcome: TrialOutcome) -> None:
        """The case in that row, in one file; why it failed before."""
        reason = self.path / "reason" / str(row)
        if outcome.reason:
            self._folder.write("reason", row, np.array([outcome.reason]), self._reasons)
        else:
            reason.unlink(missing_ok=True)
        self._folder.write("values", row, np.array([outcome.values]), self._rows)

    # --- reading ---------------------------------------------------------------------------------

    def __len__(self) -> int:
        return len(self.cases)

    @property
    def units(self) -> dict[str, str]:
        """Unit of every quantity."""
        return dict(self.attributes["units"])

    @property
    def values(self) -> Array:
        """(case, quantity)."""
        return self._folder.whole("values", self._rows)

    @property
    def finished(self) -> Array:
        """Which cases are there, the failed ones too."""
        out = np.ones(len(self), bool)
        out[self._folder.missing("values", self._rows)] = False
        return out

    @property
    def reasons(self) -> dict[int, str]:
        """{row: why the case failed}."""
        found = self._folder.whole("reason", self._reasons).tolist()
        return {row: reason for row, reason in enumerate(found) if reason}

    def rows_of(self, cases: Sequence[Case]) -> list[int]:
        """Rows of these cases."""
        at = {case.key: row for row, case in enumerate(self.cases)}
        return [at[case.key] for case in cases]

    def __getitem__(self, name: str) -> Array:
        """A quantity or a parameter of every case (N,)."""
        if name in self.units:
            return self.values[:, list(self.units).index(name)]
        if name not in self.cases[0].parameters:
            known = [*self.units, *self.cases[0].parameters]
            raise UnknownNameError("quantity or parameter", name, known)
        return self._parameter(name)

    def to_frame(self) -> pandas.DataFrame:
        """A row a case: parameters, quantities, reason."""
        with extra("campaigns", "a data frame of a campaign"):
            import pandas
        values, units = self.values, list(self.units)
        return pandas.DataFrame(
            {name: self._parameter(name) for name in self.cases[0].parameters}
            | {name: values[:, i] for i, name in enumerate(units)}
            | {"reason": self._folder.whole("reason", self._reasons)}
        )

    def to_xarray(self) -> xarray.Dataset:
        """Quantities as variables with their units along `case`, parameters as its coordinates."""
        with extra("campaigns", "a labelled dataset of a campaign"):
            import xarray
        values = self.values
        return xarray.Dataset(
            {
                **{
                    name: ("case", values[:, i], {"units": unit})
                    for i, (name, unit) in enumerate(self.units.items())
                },
                "reason": ("case", self._folder.whole("reason", self._reasons)),
            },
            coords={name: ("case", self._parameter(name)) for name in self.cases[0].parameters},
            attrs=dict(self.attributes) | {"units": json.dumps(self.units)},
        )

    # --- writing ---------------------------------------------------------------------------------

    def _describe(self) -> None:
        """The arrays for the cases there are; chunks that are there stay."""
        units, parameters = self.units, self.cases[0].parameters
        labels = {
            "quantity": ("quantity", np.array(list(units))),
            "unit": ("quantity", np.array(list(units.values()))),
            **{name: ("case", self._parameter(name)) for name in parameters},
        }
        for name, (_, values) in labels.items():
            self._folder.keep(name, values)
        self._folder.describe(
            {
                "values": self._rows,
                "reason": self._reasons,
                **{name: ZarrArray.whole(*label) for name, label in labels.items()},
            }
        )
        self._folder.write_attributes(self.attributes)

    @property
    def _rows(self) -> ZarrArray:
        count = len(self.units)
        return ZarrArray(
            dimensions=("case", "quantity"),
            shape=(len(self), count),
            chunks=(1, count),
            dtype="<f8",
            fill=np.nan,
            coordinates=("unit", *self.cases[0].parameters),
        )

    @property
    def _reasons(self) -> ZarrArray:
        return ZarrArray(
            dimensions=("case",),
            shape=(len(self),),
            chunks=(1,),
            dtype=f"<U{LONGEST_REASON}",
            coordinates=tuple(self.cases[0].parameters),
        )

    def _parameter(self, name: str) -> Array:
        column: list[Value] = [case.parameters[name] for case in self.cases]
        return np.array(column)

    def _refuse(self, campaign: Campaign) -> None:
        trial, parameters = campaign.trial, set(campaign.cases[0].parameters)
        if self.attributes["trial"] != trial.name:
            raise InputError(
                f"{self.path} holds cases of {self.attributes['trial']}, not of {trial.name}; give"
                " another folder, or remove it"
            )
        if self.units != trial.units or set(self.cases[0].parameters) != parameters:
            raise InputError(
                f"{self.path} holds cases of {trial.name} with other parameters or quantities: an"
                " older version wrote it; give another folder, or remove it"
            )


def _digest(content: Mapping[str, Any]) -> str:
    return hashlib.sha256(json.dumps(content, sort_keys=True).encode()).hexdigest()
