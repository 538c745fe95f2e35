"""Laws of motion that no airframe changes: rigid body, inflow, drivetrain, attitude."""
