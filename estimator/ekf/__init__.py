"""An iterated extended Kalman filter with smoother, in the manner of Segal, Carmi and Gurfil (2014): the peer.

`method` is the entry; a bank of filters chooses the process noise.
Uses geometry, registration, dynamics and adjustment.
"""
