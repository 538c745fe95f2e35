"""A controller and its loop: margins, reduction, sampling, and the guarantee of the controller as
implemented.
"""
