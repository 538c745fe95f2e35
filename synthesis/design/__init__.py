"""Designs: plants, and the controllers made for them.

A design takes a `Plant`, returns a `Controller` and raises `SynthesisError` where there is none.
One of a frozen model or of a loop alone returns a `PointDesign`, which `Controller.of` takes.
What a design promises is an estimate; the analysis of `synthesis.certify` proves the loop as it
flies.

In the order of the rooms, each of which knows only those before it:

`plant`: What is designed for: `plant.py` names disturbances, controls, performance and measurements
of a model, and puts weights, servos and delays around it (`parts.py`); `generalized.py` has its
matrices, `diagnosis.py` says why there is no controller.

`loops`: A controller and its loop: `controller.py`, `margins.py` and `margin_table.py`,
`handling_qualities.py`, `reduction.py`; `sampled_loop.py` certifies the controller as implemented,
`wrong_parameter.py` under errors of the measured parameter.

`lti`: Controllers of one frozen model: `hinf.py` on `central.py`, `h2.py` on `linear_quadratic.py`,
mixed sensitivity, loop shaping, the coefficient diagram; `point_design.py` is what each returns.

`lpv`: Scheduled controllers: `output_feedback.py`, `state_feedback.py`, `estimator.py`,
`multiobjective.py`, `linear_quadratic.py`. Behind output feedback `existence.py` has the two
inequalities in X and Y, `search.py` tries which of them depends on p, `recovery.py` makes the
controller from them; `fitted.py` makes gains at single p functions of p.

`tuning`: Descent on the largest gain of many loops at once, for gains of a structure and for
controllers of uncertain models: `descent.py` on `peaks.py`.

To follow one design read plant/plant.py, lpv/output_feedback.py, search.py, existence.py,
recovery.py, then loops/controller.py and loops/sampled_loop.py.
"""
