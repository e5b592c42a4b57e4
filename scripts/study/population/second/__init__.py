"""The second population: cases drawn by somebody who had not seen the first.

Its truth, views and sensor share nothing with those of the first population, so that what one draws wrongly or leaves
out the other may show. shapes, orbits → bodies, chasers, times → motion → views → sensing → cases; what judges an
estimate is that of the first. All draws of a case come from one stream, in that order: a call moved changes every case.
"""
