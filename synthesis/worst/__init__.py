"""What no proof can beat: the worst frozen models and the worst trajectories of the parameters."""
