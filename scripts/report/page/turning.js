// Vectors as [x, y, z], rotations as nine numbers, row by row.

const IDENTITY = [1, 0, 0, 0, 1, 0, 0, 0, 1];
const dot = (a, b) => a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
const minus = (a, b) => [a[0] - b[0], a[1] - b[1], a[2] - b[2]];
const cross = (a, b) => [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]];
const norm = (a) => Math.sqrt(dot(a, a));
const turn = (R, v) => [dot(R.slice(0, 3), v), dot(R.slice(3, 6), v), dot(R.slice(6, 9), v)];
const transposed = (R) => [R[0], R[3], R[6], R[1], R[4], R[7], R[2], R[5], R[8]];

function product(A, B) {
  const T = transposed(B), found = [];
  for (let i = 0; i < 3; i += 1) for (let j = 0; j < 3; j += 1) found.push(dot(A.slice(3 * i, 3 * i + 3), T.slice(3 * j, 3 * j + 3)));
  return found;
}

function fromQuaternion(w, x, y, z) {
  return [
    1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y),
    2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x),
    2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y),
  ];
}

const quaternionProduct = ([a, b, c, d], [w, x, y, z]) => [
  a * w - b * x - c * y - d * z, a * x + b * w + c * z - d * y, a * y - b * z + c * w + d * x, a * z + b * y - c * x + d * w,
];

// The rotation a share of the shorter way from one unit quaternion (w, x, y, z) to another.
function slerp(p, q, share) {
  const cosine = p[0] * q[0] + p[1] * q[1] + p[2] * q[2] + p[3] * q[3], sign = cosine < 0 ? -1 : 1;
  const angle = Math.acos(Math.min(Math.abs(cosine), 1));
  const [a, b] = angle < 1e-6 ? [1 - share, share] : [Math.sin((1 - share) * angle) / Math.sin(angle), Math.sin(share * angle) / Math.sin(angle)];
  return p.map((one, k) => a * one + sign * b * q[k]);
}

// A symmetric matrix from its upper triangle, turned: R C Rᵀ.
function turnedCovariance(R, [a, b, c, d, e, f]) {
  return product(product(R, [a, b, c, b, d, e, c, e, f]), transposed(R));
}

// The outline of C's ellipsoid seen along z: half axes and the angle of the longer one from x. Orthographic, so it is
// the ellipse of the upper left 2 × 2 part.
function outline(C) {
  const mean = (C[0] + C[4]) / 2, half = (C[0] - C[4]) / 2, root = Math.hypot(half, C[1]);
  return { long: Math.sqrt(Math.max(mean + root, 0)), short: Math.sqrt(Math.max(mean - root, 0)), angle: 0.5 * Math.atan2(C[1], half) };
}

// What looks from azimuth and elevation, with z upwards: rows are right, up and towards the eye.
function looking(azimuth, elevation) {
  const [ca, sa, ce, se] = [Math.cos(azimuth), Math.sin(azimuth), Math.cos(elevation), Math.sin(elevation)];
  return [-sa, ca, 0, -se * ca, -se * sa, ce, ce * ca, ce * sa, se];
}
