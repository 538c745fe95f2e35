"""Flight records in, LPV models out: recursive, batch and instrumental-variable estimates of
input-output models with moving coefficients.

Units are those of the record: SI and radians. The examples of this package start from

>>> import numpy as np
>>> import identification as idn
>>> from symheli import FlightRecord
>>> rng, n = np.random.default_rng(0), 800
>>> p, u, noise = np.sin(0.05 * np.arange(n)), rng.uniform(-1, 1, n), 0.01 * rng.normal(size=n)
>>> y = np.zeros(n)
>>> for k in range(1, n):
...     y[k] = (0.5 + 0.3 * p[k - 1]) * y[k - 1] + u[k - 1] + noise[k]
>>> record = FlightRecord.from_arrays(
...     0.1 * np.arange(n), dict.fromkeys("yup", "1"), y=y, u=u, p=p
... )
>>> arx = idn.LPVARX(
...     "y", "u", "p", na=1, nb=1, delay=1, basis=idn.Polynomial(1, low=-1.0, high=1.0)
... )
>>> model = idn.fit(arx, record)

One step flatters: report one step, a horizon and the free run.

>>> for horizon in (1, 10, None):
...     print(round(float(model.score(record, horizon)["y"])))
99
98
98
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from symheli.lazy import lazily

if TYPE_CHECKING:
    from identification.design.excitation import ExcitationReport, excitation_report
    from identification.design.experiment_design import (
        Experiment,
        Plan,
        choose_experiments,
        compare_experiments,
    )
    from identification.estimators.estimate import fit
    from identification.estimators.filter_error import FilterError
    from identification.estimators.instrumental_variables import InstrumentalVariables
    from identification.estimators.instruments import (
        FlightSource,
        InstrumentSource,
        LaggedSignals,
    )
    from identification.estimators.lasso import Lasso
    from identification.estimators.least_squares import LeastSquares
    from identification.estimators.method import Estimate, Method
    from identification.estimators.output_error import OutputError
    from identification.estimators.recursion import Recursion
    from identification.estimators.refined_instruments import RefinedInstruments
    from identification.estimators.ridge import Ridge
    from identification.judge.against_constant import AgainstConstant, against_constant
    from identification.judge.beside_baseline import (
        BaselineModel,
        BaselinePredictor,
        BesideBaseline,
        beside_baseline,
    )
    from identification.judge.criterion import Criterion
    from identification.judge.dependence import DependenceReport, dependence_report
    from identification.judge.design_model import design_model
    from identification.judge.fit_for_control import FitForControl, fit_for_control
    from identification.judge.frequency_response import FrequencyResponse, frequency_response
    from identification.judge.frozen_models import FrozenModels, frozen_models, pole_miss
    from identification.judge.matrix_ellipsoid import MatrixEllipsoid, matrix_ellipsoid
    from identification.judge.order_scan import OrderScan, Trial, order_scan
    from identification.judge.residuals import ResidualAnalysis, Theil, residual_analysis, theil
    from identification.judge.response_band import ResponseBand
    from identification.judge.scores import Scores, scores
    from identification.judge.slow_modes import SlowMode, SlowModes, slow_modes
    from identification.judge.uncertainty import Band, Uncertainty, uncertainty
    from identification.judge.unseen_flight import UnseenFlight, unseen_flight
    from identification.model.coefficients import Coefficients, CoefficientValues
    from identification.model.kinematic_model import KinematicModel
    from identification.model.lpvarx_model import LPVARXModel
    from identification.model.prediction import fit_percent
    from identification.recursive.forgetting import Constant, Directional, Forgetting, Variable
    from identification.recursive.history import History
    from identification.recursive.kinematic_observer import KinematicObserver
    from identification.recursive.online import Online
    from identification.recursive.recursive_least_squares import RecursiveLeastSquares
    from identification.recursive.rigid_body_online import RigidBodyOnline
    from identification.recursive.rls_state import RLSInfo, RLSState
    from identification.structure.kinematic_arx import KinematicARX
    from identification.structure.lpvarx import LPVARX, Entry, Group, Term
    from symheli.lpv import BSpline, PiecewiseLinear, Polynomial, Product, Spline, UserFunctions

_ROOMS = {
    "identification.design.excitation": "ExcitationReport excitation_report",
    "identification.design.experiment_design": (
        "Experiment Plan choose_experiments compare_experiments"
    ),
    "identification.estimators.estimate": "fit",
    "identification.estimators.filter_error": "FilterError",
    "identification.estimators.instrumental_variables": "InstrumentalVariables",
    "identification.estimators.instruments": "FlightSource InstrumentSource LaggedSignals",
    "identification.estimators.lasso": "Lasso",
    "identification.estimators.least_squares": "LeastSquares",
    "identification.estimators.method": "Estimate Method",
    "identification.estimators.output_error": "OutputError",
    "identification.estimators.recursion": "Recursion",
    "identification.estimators.refined_instruments": "RefinedInstruments",
    "identification.estimators.ridge": "Ridge",
    "identification.judge.against_constant": "AgainstConstant against_constant",
    "identification.judge.beside_baseline": (
        "BaselineModel BaselinePredictor BesideBaseline beside_baseline"
    ),
    "identification.judge.criterion": "Criterion",
    "identification.judge.dependence": "DependenceReport dependence_report",
    "identification.judge.design_model": "design_model",
    "identification.judge.fit_for_control": "FitForControl fit_for_control",
    "identification.judge.frequency_response": "FrequencyResponse frequency_response",
    "identification.judge.frozen_models": "FrozenModels frozen_models pole_miss",
    "identification.judge.matrix_ellipsoid": "MatrixEllipsoid matrix_ellipsoid",
    "identification.judge.order_scan": "OrderScan Trial order_scan",
    "identification.judge.residuals": "ResidualAnalysis Theil residual_analysis theil",
    "identification.judge.response_band": "ResponseBand",
    "identification.judge.scores": "Scores scores",
    "identification.judge.slow_modes": "SlowMode SlowModes slow_modes",
    "identification.judge.unseen_flight": "UnseenFlight unseen_flight",
    "identification.judge.uncertainty": "Band Uncertainty uncertainty",
    "identification.model.coefficients": "Coefficients CoefficientValues",
    "identification.model.kinematic_model": "KinematicModel",
    "identification.recursive.kinematic_observer": "KinematicObserver",
    "identification.model.lpvarx_model": "LPVARXModel",
    "identification.model.prediction": "fit_percent",
    "identification.recursive.forgetting": "Constant Directional Forgetting Variable",
    "identification.recursive.history": "History",
    "identification.recursive.online": "Online",
    "identification.recursive.recursive_least_squares": "RecursiveLeastSquares",
    "identification.recursive.rigid_body_online": "RigidBodyOnline",
    "identification.recursive.rls_state": "RLSInfo RLSState",
    "identification.structure.kinematic_arx": "KinematicARX",
    "identification.structure.lpvarx": "LPVARX Entry Group Term",
    "symheli.lpv": ("BSpline PiecewiseLinear Polynomial Product Spline UserFunctions"),
}

__all__ = [
    "LPVARX",
    "AgainstConstant",
    "BSpline",
    "Band",
    "BaselineModel",
    "BaselinePredictor",
    "BesideBaseline",
    "CoefficientValues",
    "Coefficients",
    "Constant",
    "Criterion",
    "DependenceReport",
    "Directional",
    "Entry",
    "Estimate",
    "ExcitationReport",
    "Experiment",
    "FilterError",
    "FitForControl",
    "FlightSource",
    "Forgetting",
    "FrequencyResponse",
    "FrozenModels",
    "Group",
    "History",
    "InstrumentSource",
    "InstrumentalVariables",
    "KinematicARX",
    "KinematicModel",
    "KinematicObserver",
    "LPVARXModel",
    "LaggedSignals",
    "Lasso",
    "LeastSquares",
    "MatrixEllipsoid",
    "Method",
    "Online",
    "OrderScan",
    "OutputError",
    "PiecewiseLinear",
    "Plan",
    "Polynomial",
    "Product",
    "RLSInfo",
    "RLSState",
    "Recursion",
    "RecursiveLeastSquares",
    "RefinedInstruments",
    "ResidualAnalysis",
    "ResponseBand",
    "Ridge",
    "RigidBodyOnline",
    "Scores",
    "SlowMode",
    "SlowModes",
    "Spline",
    "Term",
    "Theil",
    "Trial",
    "Uncertainty",
    "UnseenFlight",
    "UserFunctions",
    "Variable",
    "against_constant",
    "beside_baseline",
    "choose_experiments",
    "compare_experiments",
    "dependence_report",
    "design_model",
    "excitation_report",
    "fit",
    "fit_for_control",
    "fit_percent",
    "frequency_response",
    "frozen_models",
    "matrix_ellipsoid",
    "order_scan",
    "pole_miss",
    "residual_analysis",
    "scores",
    "slow_modes",
    "theil",
    "uncertainty",
    "unseen_flight",
]

__version__ = "0.1.0"

__getattr__ = lazily(__name__, _ROOMS)


def __dir__() -> list[str]:
    return [*__all__, "__version__"]
