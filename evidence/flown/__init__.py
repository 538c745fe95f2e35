"""`python -m evidence.flown`: every controller on hundreds of transitions of seeds of their own,
against the specification sheet and against the scheduled LQR.
"""
