"""Flight records in, LPV models out: recursive, batch and instrumental-variable estimates of
input-output models with moving coefficients.

    arx = LPVARX(outputs=("q", "theta"), inputs=("d_lon",), scheduling="airspeed", na=2, nb=1,
                 delay=1, basis=Polynomial(2, 0.0, 13.0))
    model = fit(arx, record, method="ls")
    # one step flatters: report one step, a horizon and the free run
    model.score(record, horizon=1), model.score(record, horizon=50), model.score(record)

Units are those of the record: SI and radians.
"""

from identification.design.excitation import ExcitationReport, excitation_report
from identification.design.experiment_design import (
    Experiment,
    Plan,
    choose_experiments,
    compare_experiments,
)
from identification.estimators.estimate import fit
from identification.estimators.instrumental_variables import InstrumentalVariables
from identification.estimators.instruments import InstrumentSource, LaggedSignals
from identification.estimators.lasso import Lasso
from identification.estimators.least_squares import LeastSquares
from identification.estimators.method import Estimate, Method
from identification.estimators.output_error import OutputError
from identification.estimators.recursion import Recursion
from identification.estimators.refined_instruments import RefinedInstruments
from identification.estimators.ridge import Ridge
from identification.judge.dependence import DependenceReport, dependence_report
from identification.judge.frequency_response import FrequencyResponse, frequency_response
from identification.judge.order_scan import OrderScan, Trial, order_scan
from identification.judge.residuals import ResidualAnalysis, Theil, residual_analysis, theil
from identification.judge.response_band import ResponseBand
from identification.judge.slow_modes import SlowMode, SlowModes, slow_modes
from identification.judge.uncertainty import Band, Uncertainty, uncertainty
from identification.model.coefficients import Coefficients, CoefficientValues
from identification.model.lpvarx_model import LPVARXModel
from identification.model.prediction import fit_percent
from identification.recursive.forgetting import Constant, Directional, Forgetting, Variable
from identification.recursive.history import History
from identification.recursive.online import Online
from identification.recursive.recursive_least_squares import RecursiveLeastSquares
from identification.recursive.rls_state import RLSInfo, RLSState
from identification.structure.lpvarx import LPVARX, Entry, Group, Term
from symheli.lpv import BSpline, PiecewiseLinear, Polynomial, Product, Spline, UserFunctions

__all__ = [
    "LPVARX",
    "BSpline",
    "Band",
    "CoefficientValues",
    "Coefficients",
    "Constant",
    "DependenceReport",
    "Directional",
    "Entry",
    "Estimate",
    "ExcitationReport",
    "Experiment",
    "Forgetting",
    "FrequencyResponse",
    "Group",
    "History",
    "InstrumentSource",
    "InstrumentalVariables",
    "LPVARXModel",
    "LaggedSignals",
    "Lasso",
    "LeastSquares",
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
    "SlowMode",
    "SlowModes",
    "Spline",
    "Term",
    "Theil",
    "Trial",
    "Uncertainty",
    "UserFunctions",
    "Variable",
    "choose_experiments",
    "compare_experiments",
    "dependence_report",
    "excitation_report",
    "fit",
    "fit_percent",
    "frequency_response",
    "order_scan",
    "residual_analysis",
    "slow_modes",
    "theil",
    "uncertainty",
]
