"""Random cases with an independent truth, estimated by every method: are the claimed covariances true?

`python -m baryscope.study.population` runs them. Truth and bound are integrated and computed here, with scipy and numpy
alone; of baryscope only the estimators' public functions are used. seed, index → cases → sensing → judging → report;
`second` has cases and sensing of its own, and `populations` both by their names.
"""
