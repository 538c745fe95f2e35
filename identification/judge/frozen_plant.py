"""The plant of a loop as an identified model has it, with the scheduling held."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

from identification.model.kinematic_model import KinematicModel
from identification.model.lpvarx_model import LPVARXModel
from identification.structure.lpvarx import LPVARX
from symheli.errors import UnknownNameError
from symheli.lpv import LinearModel, LinearModels
from symheli.values.arrays import Array

Model = LPVARXModel | KinematicModel


@dataclass(frozen=True, eq=False)
class FrozenPlant:
    """`outputs` and `inputs` of a model; of known kinematics only the states that stay with them,
    as `KinematicModel.to_state_space` keeps them.

    Raises `UnknownNameError` for a signal the model does not have.
    """

    model: Model
    outputs: tuple[str, ...]
    inputs: tuple[str, ...]

    def __post_init__(self) -> None:
        for kind, names, known in (
            ("output", self.outputs, self.model.outputs),
            ("input", self.inputs, self.model.inputs),
        ):
            for name in names:
                if name not in known:
                    raise UnknownNameError(f"{kind} of the plant", name, known)

    def at(self, p: float | Sequence[float]) -> LinearModel:
        """Discrete, with the scheduling held at p."""
        if isinstance(self.model, KinematicModel):
            return self.model.at(p, self.outputs, self.inputs)
        return self.model.at(p).select(inputs=self.inputs, outputs=self.outputs)

    def of_each(self, thetas: Array, p: float | Sequence[float]) -> LinearModels:
        """The plants of coefficients (K, n, ny) in the place of the model's, at p."""
        return LinearModels.of([replace(self, model=self.with_theta(t)).at(p) for t in thetas])

    def with_theta(self, theta: Array) -> Model:
        """The model with other coefficients (n, ny)."""
        model = self.model
        if isinstance(model, KinematicModel):
            aerodynamics = replace(model.aerodynamics, theta=theta, covariance=None)
            return replace(model, aerodynamics=aerodynamics)
        return replace(model, theta=theta, covariance=None)

    @property
    def regression(self) -> LPVARX:
        """The structure whose coefficients theta are."""
        structure = self.model.structure
        return structure if isinstance(structure, LPVARX) else structure.aerodynamics
