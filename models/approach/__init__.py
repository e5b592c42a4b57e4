"""ApproachController: its guidance law, in `guidance`; its table of variables and functions, in `unit`."""
