"""Certificates: bounds that hold for every p(t) within its range and rates, found and proven.

In the order of the rooms, each of which knows only those before it:

`statement`: The claim: its kind (`demand.py`), the forms of V (`forms.py`, `spline.py`, `box.py`),
how an inequality is imposed (`impose.py`), units (`scaling.py`).

`proof`: Its check from model and V alone: `inequalities.py` writes the matrices, `one_parameter.py`
and `box.py` decide them, `pointwise.py` witnesses.

`lower_bounds`: What no proof can improve on: frozen models (`frozen.py`, `box.py`) and computed
trajectories of p (`lower_bound.py`, `ascent.py`, `periodic.py`).

`assemble`: The same inequalities as cone programs: `unknowns.py`, `bounded_real.py`, `box.py`.

`lft`: Multipliers, program and proof of LFTs, whose parameters may jump.

`questions`: `questions.py` poses, `certify.py` answers by a ladder of programs (`ladder.py`) on two
routes; `certificate.py` keeps and `certificate_file.py` saves the answer.

To believe a certificate read proof/inequalities.py, proof/one_parameter.py and certificate_file.py;
a solver is never believed. To see how one is found read questions/questions.py, certify.py,
ladder.py, then assemble. docs/architecture.md walks through `l2_gain`.
"""
