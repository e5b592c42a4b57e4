"""Two bodies on a joint, with skin that moves in several ways, drawn many times: are the joint's covariances true?

`python -m baryscope.study.joints` runs them: recordings → judging → report. The recordings use numpy and scipy alone.
"""
