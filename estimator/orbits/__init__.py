"""What the path tells of the target's orbit: an error of a given one, or all of it where none is given."""
