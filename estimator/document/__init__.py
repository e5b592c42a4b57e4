"""Files of an estimate: the path as a table, and the `document` of all else as JSON, with a documented `schema`.

`details` has what only one method tells; `files` writes both.
"""
