from identification.design.excitation import excitation_report as excitation_report
from identification.design.experiment_design import (
    Experiment as Experiment,
)
from identification.design.experiment_design import (
    Plan as Plan,
)
from identification.design.experiment_design import (
    choose_experiments as choose_experiments,
)
from identification.design.experiment_design import (
    compare_experiments as compare_experiments,
)
from identification.estimators.calibration import calibrate as calibrate
from identification.estimators.estimate import fit as fit
from identification.estimators.filter_error import FilterError as FilterError
from identification.estimators.instrumental_variables import (
    InstrumentalVariables as InstrumentalVariables,
)
from identification.estimators.instruments import (
    FlightSource as FlightSource,
)
from identification.estimators.instruments import (
    InstrumentSource as InstrumentSource,
)
from identification.estimators.instruments import (
    LaggedSignals as LaggedSignals,
)
from identification.estimators.lasso import Lasso as Lasso
from identification.estimators.least_squares import LeastSquares as LeastSquares
from identification.estimators.method import Estimate as Estimate
from identification.estimators.method import Method as Method
from identification.estimators.prediction_error import ARMAX as ARMAX
from identification.estimators.prediction_error import BoxJenkins as BoxJenkins
from identification.estimators.prediction_error import OutputError as OutputError
from identification.estimators.recursion import Recursion as Recursion
from identification.estimators.refined_instruments import RefinedInstruments as RefinedInstruments
from identification.estimators.ridge import Ridge as Ridge
from identification.judge.against_constant import (
    AgainstConstant as AgainstConstant,
)
from identification.judge.against_constant import (
    against_constant as against_constant,
)
from identification.judge.beside_baseline import (
    BaselineModel as BaselineModel,
)
from identification.judge.beside_baseline import (
    BaselinePredictor as BaselinePredictor,
)
from identification.judge.beside_baseline import (
    beside_baseline as beside_baseline,
)
from identification.judge.criteria import Criterion as Criterion
from identification.judge.dependence import dependence_report as dependence_report
from identification.judge.fit_for_control import (
    FitForControl as FitForControl,
)
from identification.judge.fit_for_control import design_model as design_model
from identification.judge.fit_for_control import (
    fit_for_control as fit_for_control,
)
from identification.judge.frequency_response import frequency_response as frequency_response
from identification.judge.frozen_models import (
    FrozenModels as FrozenModels,
)
from identification.judge.frozen_models import (
    compare_frozen as compare_frozen,
)
from identification.judge.frozen_models import (
    pole_miss as pole_miss,
)
from identification.judge.frozen_stability import (
    FrozenStability as FrozenStability,
)
from identification.judge.frozen_stability import (
    frozen_stability as frozen_stability,
)
from identification.judge.order_scan import order_scan as order_scan
from identification.judge.residuals import residual_analysis as residual_analysis
from identification.judge.residuals import theil as theil
from identification.judge.response_regions import ResponseRegions as ResponseRegions
from identification.judge.response_regions import StructureBias as StructureBias
from identification.judge.response_regions import response_regions as response_regions
from identification.judge.response_regions import structure_bias as structure_bias
from identification.judge.scores import Scores as Scores
from identification.judge.scores import scores as scores
from identification.judge.slow_modes import slow_modes as slow_modes
from identification.judge.uncertainty import uncertainty as uncertainty
from identification.judge.unseen_flight import unseen_flight as unseen_flight
from identification.model.coefficients import Coefficients as Coefficients
from identification.model.kinematic_model import KinematicModel as KinematicModel
from identification.model.lpvarx_model import LPVARXModel as LPVARXModel
from identification.model.matrix_ellipsoid import matrix_ellipsoid as matrix_ellipsoid
from identification.model.noise_model import NoiseModel as NoiseModel
from identification.model.prediction import fit_percent as fit_percent
from identification.model.state_space_model import StateSpaceModel as StateSpaceModel
from identification.recursive.forgetting import (
    Constant as Constant,
)
from identification.recursive.forgetting import (
    Directional as Directional,
)
from identification.recursive.forgetting import (
    Forgetting as Forgetting,
)
from identification.recursive.forgetting import (
    Variable as Variable,
)
from identification.recursive.history import History as History
from identification.recursive.online import Online as Online
from identification.recursive.recursive_least_squares import (
    RecursiveLeastSquares as RecursiveLeastSquares,
)
from identification.recursive.rigid_body_online import RigidBodyOnline as RigidBodyOnline
from identification.structure.actuators import Actuators as Actuators
from identification.structure.kinematic_arx import KinematicARX as KinematicARX
from identification.structure.late_sensors import LateSensors as LateSensors
from identification.structure.lpvarx import LPVARX as LPVARX
from identification.structure.steady_wind import SteadyWind as SteadyWind
from symheli.lpv import (
    BSpline as BSpline,
)
from symheli.lpv import (
    CubicSpline as CubicSpline,
)
from symheli.lpv import (
    PiecewiseLinear as PiecewiseLinear,
)
from symheli.lpv import (
    Polynomial as Polynomial,
)
from symheli.lpv import (
    Product as Product,
)
from symheli.lpv import (
    UserFunctions as UserFunctions,
)

__version__: str
from identification.structure.state_space import StateSpace as StateSpace
