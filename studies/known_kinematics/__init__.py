"""Models with known kinematics: the flights that they are identified from, their structures, the
exact models that they are compared with, and the loop proven around all that the data allow.
"""
