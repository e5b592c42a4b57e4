"""What a solution tells of the target's orbit: one that is not given, an error of a given one, J2 that it lacks."""
