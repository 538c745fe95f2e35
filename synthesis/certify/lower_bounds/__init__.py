"""Lower bounds on the gain: the worst frozen models and the worst parameter trajectories."""
