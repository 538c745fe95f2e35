"""The planar VTOL of Zhao, Lakshmanan, Ackerman, Gahlawat, Pavone and Hovakimyan (2022),
Tube-certified trajectory tracking for nonlinear systems with robust control contraction metrics,
IEEE Robotics and Automation Letters 7(2): their stored metrics between the points of their grid,
and tubes of our own.
"""
