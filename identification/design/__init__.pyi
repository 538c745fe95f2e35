from identification.design.experiment_design import Experiment as Experiment
from identification.design.experiment_design import Plan as Plan
from identification.design.experiment_design import compare_experiments as compare_experiments
from identification.judge.fit_for_control import design_model as design_model
