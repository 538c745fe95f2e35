"""The whole circle while a helicopter flies: identify, design, certify, judge, take the controls,
notice that the vehicle has changed, begin anew.
"""
