// What a stage shows at one time: { path, features, state, attitude, orbit, ghosts }.
//
// path: the centre of mass from the chaser, in C; features: their arms from it, in C; state: a digit for each feature, 0 not
// seen, 1 seen, 2 rejected; attitude, orbit: quaternions (w, x, y, z) that turn body and LVLH axes into C; ghosts: for each
// estimate { offset, covariance }, from the path and as an upper triangle. What is not known is null.

const FARTHEST_TURN = 2; // rad between two moments, from which nobody can tell which way it went

const known = (v) => Boolean(v) && v[0] !== null && v[0] !== undefined;

// What a feature or estimate does between two moments: it goes straight, and the body turns about one axis.
function between(one, other, share) {
  const near = share < 0.5 ? one : other;
  const mixed = (a, b, nearest) => (known(a) && known(b) ? a.map((value, k) => value + share * (b[k] - value)) : nearest);
  const turned = (p, q, nearest) => (known(p) && known(q) && apart(p, q) < FARTHEST_TURN ? slerp(p, q, share) : nearest);
  const attitude = turned(one.attitude, other.attitude, near.attitude);
  const from = attitude !== near.attitude && [one, other].map((moment) => product(fromQuaternion(...attitude), transposed(fromQuaternion(...moment.attitude))));
  const arm = (j) => {
    const ends = [one, other].map((moment, k) => (known(moment.features[j]) ? turn(from[k], moment.features[j]) : null));
    return mixed(ends[0], ends[1], share < 0.5 ? ends[0] : ends[1]);
  };
  return {
    path: mixed(one.path, other.path, near.path),
    features: from ? near.features.map((_, j) => arm(j)) : near.features,
    state: near.state,
    attitude,
    orbit: turned(one.orbit, other.orbit, near.orbit),
    ghosts: near.ghosts.map((ghost, index) => ({
      offset: mixed(one.ghosts[index].offset, other.ghosts[index].offset, ghost.offset),
      covariance: mixed(one.ghosts[index].covariance, other.ghosts[index].covariance, ghost.covariance),
    })),
  };
}

const apart = (p, q) => 2 * Math.acos(Math.min(Math.abs(p[0] * q[0] + p[1] * q[1] + p[2] * q[2] + p[3] * q[3]), 1));

// The standard deviation of a point, from the upper triangle of its covariance.
const deviation = (C) => Math.sqrt(C[0] + C[3] + C[5]);

// A moment in words: range, features and how far each estimate that is shown is off.
function wordsOf(moment, labels, ghosts) {
  const digits = [...moment.state], seen = digits.filter((one) => one !== "0").length, rejected = digits.filter((one) => one === "2").length;
  const words = [`range ${length(norm(moment.path))}`, `${seen} of ${labels.length} features seen${rejected ? `, ${rejected} rejected` : ""}`];
  moment.ghosts.forEach(({ offset, covariance }, index) => {
    if (!ghosts[index].shown || !known(offset)) return;
    const claim = known(covariance) ? `±${length(deviation(covariance))}` : "", off = norm(offset) ? `off by ${length(norm(offset))}` : "";
    if (claim || off) words.push(`${ghosts[index].label} ${[off, claim].filter(Boolean).join(", ")}`);
  });
  return words;
}
