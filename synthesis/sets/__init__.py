"""Invariant sets of LPV models within limits of states and controls, proven between the scheduling
points, and a governor that keeps any command inside.
"""
