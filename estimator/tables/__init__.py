"""Tables in CSV files: read by columns, the fast way or strictly, and the rows of tracks.

`table` reads one of any form; `tracks` knows that of feature tracks. Errors name the file, the line and the column.
Uses geometry.
"""
