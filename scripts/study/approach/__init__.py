"""An approach to a grapple point on estimates alone, drawn many times: by the online estimator or the published method.

`python -m baryscope.study.approach` runs it: draws → flying → report. `onboard` is the published
method on board, `thrusters` are thrusters that are wrong.
"""
