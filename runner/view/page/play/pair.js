// The ego and its partner: name, the shortest line between their boxes, and its measures.

const ROOM = [70, 54]; // px that are left free beside and above a pair
const CLOSEST = 16; // px per m at which a pair is seen at most

/** What holds at a sample of stretches [first sample, name]; an empty name for nobody. */
function during(stretches, time, length) {
  const sample = time / length + 1e-6,
    found = stretches.findLast(([start]) => start <= sample);
  return found ? found[1] : "";
}

/** Corners of a participant's box, m. */
function corners(track, state) {
  const [bx, by, length, width] = track.box,
    [c, s] = [Math.cos(state.h), Math.sin(state.h)];
  return [
    [1, 1],
    [1, -1],
    [-1, -1],
    [-1, 1],
  ].map(([a, b]) => {
    const [u, v] = [bx + (a * length) / 2, by + (b * width) / 2];
    return [state.x + u * c - v * s, state.y + u * s + v * c];
  });
}

/** The place of a box that is nearest to a point. */
function nearestOf(track, state, [x, y]) {
  const [bx, by, length, width] = track.box,
    [c, s] = [Math.cos(state.h), Math.sin(state.h)];
  const [dx, dy] = [x - state.x, y - state.y],
    clamp = (value, middle, size) => Math.min(middle + size / 2, Math.max(middle - size / 2, value));
  const u = clamp(dx * c + dy * s, bx, length),
    v = clamp(dy * c - dx * s, by, width);
  return [state.x + u * c - v * s, state.y + u * s + v * c];
}

/** The shortest line between two boxes that do not overlap: both ends and its length. */
function between(a, stateA, b, stateB) {
  const lines = [
    ...corners(a, stateA).map(point => [point, nearestOf(b, stateB, point)]),
    ...corners(b, stateB).map(point => [nearestOf(a, stateA, point), point]),
  ];
  const long = ([[x, y], [u, v]]) => Math.hypot(u - x, v - y);
  const [from, to] = lines.reduce((best, line) => (long(line) < long(best) ? line : best));
  return { from, to, length: long([from, to]) };
}

/** Middle and scale that keep participants in sight. */
function framing(tracks, states, width, height) {
  const points = tracks.flatMap((track, i) => corners(track, states[i])),
    [xs, ys] = [points.map(([x]) => x), points.map(([, y]) => y)];
  const [west, east, south, north] = [Math.min(...xs), Math.max(...xs), Math.min(...ys), Math.max(...ys)];
  const room = (size, free) => Math.max(size - 2 * free, size / 3);
  return {
    middle: [(west + east) / 2, (south + north) / 2],
    scale: Math.min(room(width, ROOM[0]) / (east - west), room(height, ROOM[1]) / (north - south), CLOSEST),
  };
}
