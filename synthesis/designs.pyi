from synthesis.design.lpv.bounded_truncation import bounded_truncation as bounded_truncation
from synthesis.design.lpv.loop_shaping import LoopShaping as LoopShaping
from synthesis.design.lpv.loop_shaping import loop_shaping as loop_shaping
from synthesis.design.lpv.output_feedback import lft_feedback as lft_feedback
from synthesis.design.lti.coefficient_diagram import coefficient_diagram as coefficient_diagram
from synthesis.design.lti.loop_shaping import ncfsyn as ncfsyn
from synthesis.design.lti.mixed_sensitivity import mixed_sensitivity as mixed_sensitivity
from synthesis.design.lti.point_design import DesignStatus as DesignStatus
