from synthesis.analysis.gain_against_rate import gain_against_rate as gain_against_rate
from synthesis.analysis.questions import (
    decay_rate as decay_rate,
)
from synthesis.analysis.questions import (
    generalized_h2 as generalized_h2,
)
from synthesis.analysis.questions import (
    h2_gain as h2_gain,
)
from synthesis.analysis.questions import (
    l2_gain as l2_gain,
)
from synthesis.analysis.questions import (
    stability as stability,
)
from synthesis.analysis.robust_margin import RobustMargin as RobustMargin
from synthesis.analysis.robust_margin import robust_margin as robust_margin
from synthesis.analysis.worst_case_gain import WorstCaseGain as WorstCaseGain
from synthesis.analysis.worst_case_gain import worst_case_gain as worst_case_gain
from synthesis.certificate import Certificate as Certificate
from synthesis.certificate import Status as Status
from synthesis.forms import HigherOrder as HigherOrder
from synthesis.forms import Memory as Memory
from synthesis.forms import Spline as Spline
from synthesis.gain_curve import GainCurve as GainCurve
from synthesis.impose import (
    Bernstein as Bernstein,
)
from synthesis.impose import (
    Grid as Grid,
)
from synthesis.impose import (
    SumOfSquares as SumOfSquares,
)
from synthesis.impose import (
    Vertices as Vertices,
)
from synthesis.lft.gain import lft_gain as lft_gain
from synthesis.lft.gain import lft_stability as lft_stability
from synthesis.lft.multipliers import SCALINGS as SCALINGS
from synthesis.loops.controller import Controller as Controller
from synthesis.loops.frozen_reading import proven_around as proven_around
from synthesis.loops.handling_qualities import bandwidth as bandwidth
from synthesis.loops.margin_table import MarginTable as MarginTable
from synthesis.loops.margin_table import margin_table as margin_table
from synthesis.loops.margins import (
    Margins as Margins,
)
from synthesis.loops.margins import (
    disk_margin as disk_margin,
)
from synthesis.loops.margins import (
    loop as loop,
)
from synthesis.loops.margins import (
    margins as margins,
)
from synthesis.loops.sampled_loop import certify_sampled as certify_sampled
from synthesis.loops.wrong_parameter import with_wrong_parameter as with_wrong_parameter
from synthesis.lpv.bounded_truncation import bounded_truncation as bounded_truncation
from synthesis.lpv.estimator import Estimator as Estimator
from synthesis.lpv.estimator import estimator as estimator
from synthesis.lpv.linear_quadratic import lqg as lqg
from synthesis.lpv.linear_quadratic import lqr as lqr
from synthesis.lpv.loop_shaping import LoopShaping as LoopShaping
from synthesis.lpv.loop_shaping import loop_shaping as loop_shaping
from synthesis.lpv.multiobjective import multiobjective as multiobjective
from synthesis.lpv.objectives import (
    H2 as H2,
)
from synthesis.lpv.objectives import (
    L2 as L2,
)
from synthesis.lpv.objectives import (
    EnergyToPeak as EnergyToPeak,
)
from synthesis.lpv.objectives import (
    PoleRegion as PoleRegion,
)
from synthesis.lpv.output_feedback import (
    lft_feedback as lft_feedback,
)
from synthesis.lpv.output_feedback import (
    output_feedback as output_feedback,
)
from synthesis.lpv.state_feedback import state_feedback as state_feedback
from synthesis.lti.coefficient_diagram import cdm as cdm
from synthesis.lti.h2 import h2 as h2
from synthesis.lti.hinf import hinf as hinf
from synthesis.lti.loop_shaping import ncf as ncf
from synthesis.lti.mixed_sensitivity import mixed_sensitivity as mixed_sensitivity
from synthesis.lti.mu_synthesis import MuDesign as MuDesign
from synthesis.lti.mu_synthesis import mu_synthesis as mu_synthesis
from synthesis.lti.point_design import DesignStatus as DesignStatus
from synthesis.plant.plant import Plant as Plant
from synthesis.polynomial.matrix import PolynomialMatrix as PolynomialMatrix
from synthesis.program.cone_program import Solver as Solver
from synthesis.program.cone_program import installed_solvers as installed_solvers
from synthesis.robust.slope import SlopeMargin as SlopeMargin
from synthesis.robust.slope import slope_margin as slope_margin
from synthesis.robust.structure import DynamicBlock as DynamicBlock
from synthesis.sets.governor import Governor as Governor
from synthesis.sets.governor import governor as governor
from synthesis.sets.invariant_set import InvariantSet as InvariantSet
from synthesis.sets.invariant_set import invariant_set as invariant_set
from synthesis.sets.low_complexity import LowComplexitySet as LowComplexitySet
from synthesis.sets.low_complexity import low_complexity_set as low_complexity_set
from synthesis.sets.switch import SwitchInside as SwitchInside
from synthesis.sheet.evaluation import SpecificationTable as SpecificationTable
from synthesis.sheet.evaluation import specifications as specifications
from synthesis.sheet.sheet import Sheet as Sheet
from synthesis.structures.design import StructuredController as StructuredController
from synthesis.structures.design import structured as structured
from synthesis.structures.structure import Gain as Gain
from synthesis.structures.structure import Structure as Structure
from synthesis.switching.dwell_time import DwellTime as DwellTime
from synthesis.switching.dwell_time import dwell_time as dwell_time
from synthesis.switching.switched import SwitchedController as SwitchedController
from synthesis.switching.switched import switched as switched
from synthesis.tubes.coverage import Coverage as Coverage
from synthesis.tubes.coverage import coverage as coverage
from synthesis.tubes.gain import LocalGain as LocalGain
from synthesis.tubes.motions import Motions as Motions
from synthesis.tubes.tube import Tube as Tube
from synthesis.tubes.tube import tube as tube
from synthesis.worst.frozen import frozen_gain as frozen_gain
from synthesis.worst.lft import frozen_box_gain as frozen_box_gain
from synthesis.worst.lower_bound import Search as Search
from synthesis.worst.lower_bound import lower_bound as lower_bound

__version__: str
