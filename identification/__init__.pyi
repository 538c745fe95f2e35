from identification import design as design
from identification import forgetting as forgetting
from identification import judge as judge
from identification import methods as methods
from identification import model as model
from identification import recursive as recursive
from identification import structure as structure
from identification.design.excitation import excitation_report as excitation_report
from identification.design.experiment_design import choose_experiments as choose_experiments
from identification.estimators.calibration import calibrate as calibrate
from identification.estimators.estimate import fit as fit
from identification.judge.fit_for_control import fit_for_control as fit_for_control
from identification.judge.frequency_response import frequency_response as frequency_response
from identification.judge.frozen_models import compare_frozen as compare_frozen
from identification.judge.order_scan import order_scan as order_scan
from identification.judge.residuals import residual_analysis as residual_analysis
from identification.judge.scores import scores as scores
from identification.judge.uncertainty import uncertainty as uncertainty
from identification.recursive.recursive_least_squares import (
    RecursiveLeastSquares as RecursiveLeastSquares,
)
from identification.recursive.rigid_body_online import RigidBodyOnline as RigidBodyOnline
from identification.structure.actuators import Actuators as Actuators
from identification.structure.kinematic_arx import KinematicARX as KinematicARX
from identification.structure.lpvarx import LPVARX as LPVARX
from identification.structure.state_space import StateSpace as StateSpace
from symheli.lpv.bases.polynomial import Polynomial as Polynomial

__version__: str
