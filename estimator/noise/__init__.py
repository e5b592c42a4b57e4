"""What a recording's noise is, beside one deviation that holds all along: what is told of it, and how it changes.

changes → following, a_priori: what `methods` calls around each fit. Uses registration, result and claims.
"""
