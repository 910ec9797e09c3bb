// What packing.py writes, read back.

/** Numbers from base64 of variable-length integers that hold differences of the given order. */
function unpack(text, order, step) {
  const bytes = atob(text),
    values = [];
  for (let i = 0; i < bytes.length;) {
    let value = 0,
      weight = 1,
      byte;
    do {
      byte = bytes.charCodeAt(i++);
      value += (byte & 127) * weight;
      weight *= 128;
    } while (byte > 127);
    values.push(value % 2 ? -(value + 1) / 2 : value / 2);
  }
  for (let n = 0; n < order; n++) for (let i = 1; i < values.length; i++) values[i] += values[i - 1];
  return Float64Array.from(values, value => value * step);
}

/** Polylines or rings as x, y and z of their points; z is null where it is 0 everywhere. */
function unpackLines([lengths, ...axes], step) {
  const [x, y, z] = axes.map(text => unpack(text, 1, step));
  let next = 0;
  return Array.from(unpack(lengths, 0, 1), length => {
    const begin = next,
      some = values => (values ? values.subarray(begin, begin + length) : null);
    next += length;
    return { x: some(x), y: some(y), z: some(z) };
  });
}

/** Polylines or rings as one path in world coordinates. */
function unpackPath(lines, step, closed) {
  const path = new Path2D();
  for (const { x, y } of unpackLines(lines, step)) {
    path.moveTo(x[0], y[0]);
    for (let i = 1; i < x.length; i++) path.lineTo(x[i], y[i]);
    if (closed) path.closePath();
  }
  return path;
}

function unpackTrack(track, steps) {
  const parts = track.parts.map(part => ({
    start: part.start,
    x: unpack(part.x, 2, steps.length),
    y: unpack(part.y, 2, steps.length),
    h: unpack(part.h, 2, steps.angle),
    v: unpack(part.v, 2, steps.speed),
    z: part.z ? unpack(part.z, 2, steps.length) : null,
    pitch: part.pitch ? unpack(part.pitch, 2, steps.angle) : null,
    roll: part.roll ? unpack(part.roll, 2, steps.angle) : null,
  }));
  const way = new Path2D();
  for (const { x, y } of parts) {
    way.moveTo(x[0], y[0]);
    for (let i = 1; i < x.length; i++) way.lineTo(x[i], y[i]);
  }
  return { ...track, parts, way };
}

/** The part of a series that is there at a sample (a fraction of one after its last is), or undefined. */
function partAt(parts, sample, count) {
  return parts.find(part => sample >= part.start && sample < part.start + count(part));
}

/** A participant's state at a time: x, y in m, h in rad, v in m/s, and whether it brakes; null while it is absent. */
function stateAt(track, time, length) {
  const sample = time / length + 1e-6;
  const part = partAt(track.parts, sample, each => each.x.length);
  if (!part) return null;
  const i = Math.floor(sample - part.start),
    j = Math.min(i + 1, part.x.length - 1),
    f = sample - part.start - i;
  const mix = values => values[i] + (values[j] - values[i]) * f;
  const slowing = part.v[Math.max(0, j - 2)] - part.v[j];
  return {
    x: mix(part.x),
    y: mix(part.y),
    h: mix(part.h),
    v: mix(part.v),
    brakes: part.v[i] > 0.1 && slowing > 1.0 * 2 * length,
  };
}

/** A curve's value at a time, or null where it is not defined. */
function valueAt(curve, time, length) {
  const sample = time / length + 1e-6;
  const part = partAt(curve.parts, sample, each => each.values.length);
  return part ? part.values[Math.floor(sample - part.start)] : null;
}

function unpackRun(run, data) {
  const curves = run.curves.map(curve => ({
    ...curve,
    parts: curve.parts.map(part => ({ start: part.start, values: unpack(part.values, 1, data.steps.speed) })),
  }));
  const ttc = curves.find(curve => curve.id === "ttc");
  return { ...run, curves, ttc, tracks: run.tracks.map(track => unpackTrack(track, data.steps)) };
}

function unpackRoad(road, steps) {
  return {
    signals: road.signals,
    objects: road.objects.map(each => ({ ...each, path: unpackPath(each.lines, steps.length, true) })),
    surfaces: road.surfaces.map(each => ({ ...each, path: unpackPath(each.lines, steps.length, true) })),
    marks: road.marks.map(each => ({ ...each, path: unpackPath(each.lines, steps.length, false) })),
  };
}
