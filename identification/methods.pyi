from identification.estimators.filter_error import FilterError as FilterError
from identification.estimators.innovations import Innovations as Innovations
from identification.estimators.instrumental_variables import (
    InstrumentalVariables as InstrumentalVariables,
)
from identification.estimators.instruments import FlightSource as FlightSource
from identification.estimators.instruments import InstrumentSource as InstrumentSource
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
from identification.estimators.subspace import Subspace as Subspace
from identification.model.noise_model import NoiseModel as NoiseModel
