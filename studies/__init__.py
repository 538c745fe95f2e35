"""The stories: command line, the transition study, its report."""
