"""The online estimator frame by frame, beside the causal bound: that of all observations up to a time.

`python -m baryscope.study.online` runs it on the worlds and on the population, whose truths it uses: flights → judging
→ report.
"""
