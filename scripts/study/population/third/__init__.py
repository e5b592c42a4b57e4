"""A third population, drawn on its own: worlds that depart a little from what the estimators assume.

`mismatches` says which departures a case has; `bodies`, `flight`, `laboratory` and `timing` draw its nominal world;
`forces`, `relative`, `tumble`, `sensor` and `blunders` hold the departures with their sizes; `cases` joins them.
"""
