"""The main job: one transition, from equations to certified gains."""
