"""ApproachController: the law in `guidance`, what it does without navigation in `reckoning`.

`thrusters` corrects the command for what these are wrong by; `unit` is all of it as a unit.
"""
