"""Design plants: channels and weights, closed loops, and the diagnosis of plants without a
controller.
"""
