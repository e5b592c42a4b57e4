"""Solutions that don't use baryscope's equations: two-body orbits in closed form, tight integrations by scipy."""

import numpy as np
from scipy.integrate import solve_ivp
from scipy.optimize import brentq
from scipy.spatial.transform import Rotation
from scipy.special import ellipj, ellipkinc


def propagate_kepler(r0, v0, mu, time):
    """Position and velocity on a Kepler orbit after `time`, by Lagrange's f and g (Battin 1999, §4.3)."""
    r0, v0 = np.asarray(r0, dtype=np.longdouble), np.asarray(v0, dtype=np.longdouble)
    mu, time = np.longdouble(mu), np.longdouble(time)
    radius = np.sqrt(r0 @ r0)
    a = 1 / (2 / radius - v0 @ v0 / mu)
    n = np.sqrt(mu / a**3)
    sigma = r0 @ v0 / np.sqrt(mu * a)

    def fault(dE):
        return dE - (1 - radius / a) * np.sin(dE) + sigma * (1 - np.cos(dE)) - n * time

    guess = float(n * time)
    dE = np.longdouble(brentq(lambda E: float(fault(np.longdouble(E))), guess - 4, guess + 4, xtol=1e-12))
    for _ in range(3):  # Newton, in extended precision
        dE -= fault(dE) / (1 - (1 - radius / a) * np.cos(dE) + sigma * np.sin(dE))
    s, c = np.sin(dE), np.cos(dE)
    f, g = 1 - a / radius * (1 - c), time - (dE - s) / n
    r = f * r0 + g * v0
    distance = np.sqrt(r @ r)
    v = -np.sqrt(mu * a) / (distance * radius) * s * r0 + (1 - a / distance * (1 - c)) * v0
    return r, v


def inertial_states(orbit, chaser_position_L, chaser_velocity_L):
    """Inertial position and velocity of target and chaser at time 0, from elements and the LVLH state."""
    R_I_P = Rotation.from_euler("ZXZ", [orbit.raan, orbit.inclination, orbit.argument_of_periapsis]).as_matrix()
    theta, e, mu = orbit.true_anomaly, orbit.eccentricity, orbit.gravitational_parameter
    p = orbit.semi_major_axis * (1 - e**2)
    up = R_I_P @ [np.cos(theta), np.sin(theta), 0]
    r = p / (1 + e * np.cos(theta)) * up
    v = np.sqrt(mu / p) * (R_I_P @ [-np.sin(theta), e + np.cos(theta), 0])
    normal = np.cross(r, v)
    R_I_L = np.column_stack([up, np.cross(normal / np.linalg.norm(normal), up), normal / np.linalg.norm(normal)])
    spin = normal / (r @ r)
    offset = R_I_L @ np.asarray(chaser_position_L)
    return (r, v), (r + offset, v + R_I_L @ np.asarray(chaser_velocity_L) + np.cross(spin, offset))


def com_in_chaser_frame(scenario, time):
    """The target's CoM in frame C at each time: the difference of two Kepler orbits."""
    target, chaser = inertial_states(scenario.orbit, scenario.chaser.position, scenario.chaser.velocity)
    mu = scenario.orbit.gravitational_parameter
    return np.array(
        [propagate_kepler(*target, mu, t)[0] - propagate_kepler(*chaser, mu, t)[0] for t in time], dtype=float
    )


def cross(a, b):
    """The cross product of two vectors (3,), for slopes that are asked for thousands of times: numpy's, which is of
    arrays of any shape, takes several times as long.
    """
    (x, y, z), (u, v, w) = a, b
    return np.array([y * w - z * v, z * u - x * w, x * v - y * u])


def torque_free_attitude(scenario, time):
    """Attitude quaternions (w, x, y, z) at each time, by scipy's DOP853 at 1e-13 on plain numpy equations."""
    J = np.array(scenario.target.inertia)
    J_inverse = np.linalg.inv(J)

    def rates(_, state):
        w, x, y, z = state[:4]
        omega = state[4:]
        a, b, c = omega
        q_dot = 0.5 * np.array(
            [-x * a - y * b - z * c, w * a + y * c - z * b, w * b + z * a - x * c, w * c + x * b - y * a]
        )
        return np.concatenate([q_dot, J_inverse @ cross(J @ omega, omega)])

    start = np.concatenate([scenario.target.attitude, np.deg2rad(scenario.target.angular_rate_deg)])
    solution = solve_ivp(rates, (0, time[-1]), start, "DOP853", time, rtol=1e-13, atol=1e-15)
    return solution.y[:4].T


def angle_between(q, p):
    """Angle of the rotation between two quaternions (w, x, y, z), rad, good to 1e-15 for small angles."""
    R_q, R_p = (Rotation.from_quat(a, scalar_first=True) for a in (q, p))
    return (R_q.inv() * R_p).magnitude()


class TorqueFree:
    """The closed solution (Landau, Lifshitz, Mechanics, §37) through a given ω(0), in principal axes I₁ < I₂ < I₃.

    ω is Jacobi's functions; the Euler angles θ and ψ follow from the angular momentum, and φ from one quadrature
    (twenty-point Gauss–Legendre over a second).
    """

    def __init__(self, J, rate):
        self.moments, axes = np.linalg.eigh(J)
        self.R_B_P = axes * np.linalg.det(axes)
        w1, w2, w3 = start = self.R_B_P.T @ rate
        I1, I2, I3 = self.moments
        twice_energy, self.momentum = start @ (self.moments * start), np.linalg.norm(self.moments * start)
        high, low = twice_energy * I3 - self.momentum**2, self.momentum**2 - twice_energy * I1
        self.about_greatest = self.momentum**2 > twice_energy * I2
        if not self.about_greatest:
            high, low, I1, I3, w1, w3 = low, high, I3, I1, w3, w1
        # From here on axis 3 is the one that ω circles, and axis 1 the other extreme.
        self.amplitudes = np.sqrt(
            [high / (I1 * (I3 - I1)), high / (I2 * (I3 - I2)), low / (I3 * (I3 - I1))]
            if self.about_greatest
            else [high / (I1 * (I1 - I3)), high / (I2 * (I2 - I3)), low / (I3 * (I1 - I3))]
        )
        self.speed = np.sqrt(abs(I3 - I2) * low / (I1 * I2 * I3))
        self.modulus = abs(I2 - I1) * high / (abs(I3 - I2) * low)
        # The solution has ω₃ > 0; a half turn about axis 2 or axis 1 brings any start there.
        self.signs = np.array([1.0, np.sign(w3), np.sign(w3)])
        amplitude = np.arctan2(self.signs[1] * w2 / self.amplitudes[1], w1 / self.amplitudes[0])
        self.phase = ellipkinc(amplitude, self.modulus)

    def principal_rate(self, time):
        sn, cn, dn, _ = ellipj(self.phase + self.speed * time, self.modulus)
        a1, a2, a3 = self.amplitudes[:, None] * self.signs[:, None] * np.array([cn, sn, dn]).reshape(3, -1)
        return np.array([a1, a2, a3] if self.about_greatest else [a3, a2, a1]).T.reshape(*np.shape(time), 3)

    def rate(self, time):
        """ω in B, (n, 3)."""
        return self.principal_rate(time) @ self.R_B_P.T

    def attitude(self, time):
        """R_I_B at 0, 1, 2 … s, with I such that R_I_B(0) = 1."""
        nodes, weights = np.polynomial.legendre.leggauss(20)
        at = time[:-1, None] + (nodes + 1) / 2
        w = self.principal_rate(at.ravel()).reshape(*at.shape, 3)
        I1, I2, _ = self.moments
        M, w1, w2 = self.momentum, w[..., 0], w[..., 1]
        phi_dot = M * (I1 * w1**2 + I2 * w2**2) / ((I1 * w1) ** 2 + (I2 * w2) ** 2)
        phi = np.concatenate([[0], np.cumsum(phi_dot @ weights / 2)])
        m = self.principal_rate(time) * self.moments / M
        theta, psi = np.arccos(m[:, 2]), np.arctan2(m[:, 0], m[:, 1])
        R_H_B = Rotation.from_euler("ZXZ", np.column_stack([phi, theta, psi])) * Rotation.from_matrix(self.R_B_P.T)
        return R_H_B[0].inv() * R_H_B


def relative_kepler(orbit, state, time, epoch=0.0):
    """[ρ; ρ̇] in LVLH at each time from that at the epoch: two Kepler orbits subtracted, in extended precision."""
    mu, a, e = (np.longdouble(x) for x in (orbit.gravitational_parameter, orbit.semi_major_axis, orbit.eccentricity))
    theta, p = np.longdouble(orbit.true_anomaly), a * (1 - e**2)
    c, s = np.cos(theta), np.sin(theta)
    target = propagate_kepler(
        p / (1 + e * c) * np.array([c, s, 0]), np.sqrt(mu / p) * np.array([-s, e + c, 0]), mu, epoch
    )

    def lvlh(r, v):
        """R_L_I and its rate about z."""
        spin = np.cross(r, v) / (r @ r)
        rate, radius = np.sqrt(spin @ spin), np.sqrt(r @ r)
        return np.array([r / radius, np.cross(spin, r) / (rate * radius), spin / rate]), np.array([0, 0, rate])

    state = np.asarray(state, dtype=np.longdouble)
    R_L_I, rate = lvlh(*target)
    chaser = (target[0] + R_L_I.T @ state[:3], target[1] + R_L_I.T @ (state[3:] + np.cross(rate, state[:3])))
    path = []
    for t in np.asarray(time, dtype=np.longdouble) - epoch:
        (r, v), (r_chaser, v_chaser) = (propagate_kepler(*start, mu, t) for start in (target, chaser))
        R_L_I, rate = lvlh(r, v)
        rho = R_L_I @ (r_chaser - r)
        path.append(np.concatenate([rho, R_L_I @ (v_chaser - v) - np.cross(rate, rho)]))
    return np.array(path, dtype=float)


def oblate_gravity(position, mu=3.986004418e14, j2=1.08262668e-3, radius=6378137.0):
    """Gravity of the Earth with J2 at a position (3,), m/s², coordinate by coordinate (Vallado 2013, 8-30)."""
    x, y, z = position
    square = x * x + y * y + z * z
    distance = square**0.5
    k = 1.5 * j2 * mu * radius**2 / distance**5
    pull = mu / distance**3
    return np.array(
        [
            -pull * x - k * x * (1 - 5 * z * z / square),
            -pull * y - k * y * (1 - 5 * z * z / square),
            -pull * z - k * z * (3 - 5 * z * z / square),
        ]
    )


def fallen(orbit, place, velocity, time, gravity=oblate_gravity):
    """The target's position and velocity (n, 6) from the chaser in inertial axes at times (n,) from 0, s: both fall by
    a gravity, integrated together, so that errors of the steps are common.

    place, velocity (3,): the chaser's in LVLH, m and m/s.
    """

    def slope(_, s):
        return np.concatenate([s[3:6], gravity(s[:3]), s[9:], gravity(s[6:9])])

    start = np.array(inertial_states(orbit, place, velocity), dtype=float).ravel()
    found = solve_ivp(slope, (0.0, time[-1]), start, "DOP853", time, rtol=1e-13, atol=1e-6).y
    return (found[:6] - found[6:]).T


def slope_of(function, size, *others):
    """The function of time and x (size,) that `solve_ivp` asks for, of a function of CasADi of x and others, which are
    arrays or functions of time. It reads and writes numpy's memory: a call that converts takes ten times as long.
    """
    buffer, run = function.buffer()
    state, slope = np.empty(size), np.empty(size)
    held = [state, *(np.array(one(0.0) if callable(one) else one, dtype=float) for one in others)]
    moving = [(own, one) for own, one in zip(held[1:], others, strict=True) if callable(one)]
    for index, one in enumerate(held):
        buffer.set_arg(index, one.data)
    buffer.set_res(0, slope.data)

    def slopes(t, x, _alive=(buffer, held)):
        state[:] = x
        for own, one in moving:
            own[:] = one(t)
        run()
        return slope.copy()

    return slopes
