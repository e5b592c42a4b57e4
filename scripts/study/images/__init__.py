"""Images of a tumbling satellite, rendered here, tracked, and estimated from: errors and claims of the whole chain.

`python -m baryscope.study.images` runs it: body → render → scene → judging → report. Needs the extra `images`.
"""
