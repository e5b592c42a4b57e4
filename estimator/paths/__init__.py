"""Models of the path of the centre of mass, each linear in its unknowns near them, with Jacobian and prior.

`path` says what one is; `polynomials`, `relative_motion` and others beside it are paths, which `extended_path` joins
with `forces`, `burns` and `process_noise`. `linear_motion` integrates what they are on an orbit; `sampled_path`,
`interpolated_path` and `blocks` hold what they are at many times. `trajectory` chooses one.
"""
