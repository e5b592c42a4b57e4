"""ApproachController: the law in `guidance`, what it does without navigation in `reckoning`, the unit in `unit`."""
