// Participants as bodies: in metres of their own frame, the reference point on the ground at the origin.

const [RED, AMBER, LAMP, DARK, PALE, SKIN] = ["#ff2a1a", "#ffb020", "#fff6d8", "#24292f", "#f4f6f8", "#d9a98a"].map(paint);
const OWN = paint("own");
const FLASHES = 1.5; // a second
const STRIDE = 1.4; // m of two steps

/** A participant's body and moving parts: wheels, steered wheels and legs, each with a place and a size. */
function bodyOf(track) {
  const [x, y, length, width, z, height] = track.box;
  const frame = { mesh: new Mesh(), parts: [], x, y, length, width, low: z - height / 2, height };
  frame.at = (along, up) => [x + along * length, frame.low + up * height];
  const build =
    track.kind === "pedestrian"
      ? walker
      : track.kind !== "vehicle"
        ? block
        : CYCLES.has(track.category)
          ? rider
          : HEAVY.has(track.category) || track.category === "van"
            ? heavy
            : sedan;
  build(frame, track.category);
  return frame;
}

function block({ mesh, x, y, length, width, low, height }) {
  const side = [x - length / 2, x + length / 2, width / 2];
  mesh.frustum([...side, low], [...side, low + height], OWN, { y });
}

/** Lamps at the ends of a vehicle, between two heights. */
function lamps({ mesh, x, y, length, width }, low, high) {
  const half = width / 2;
  for (const side of [1, -1]) {
    const turn = side > 0 ? LAMPS.left : LAMPS.right;
    for (const [end, own, lamp] of [
      [1, LAMP, LAMPS.head],
      [-1, RED, LAMPS.brake],
    ]) {
      const at = x + (end * length) / 2,
        out = at + end * 0.03;
      const [a, b] = [Math.min(at, out), Math.max(at, out)];
      for (const [from, to, what, which] of [
        [0.5, 0.78, own, lamp],
        [0.8, 0.97, AMBER, turn],
      ]) {
        const middle = (side * half * (from + to)) / 2,
          w = (half * (to - from)) / 2;
        mesh.frustum([a, b, w, low], [a, b, w, high], what, { lamp: which, y: y + middle });
      }
      if (end < 0)
        mesh.frustum([a, b, half * 0.1, low], [a, b, half * 0.1, high], LAMP, {
          lamp: LAMPS.back,
          y: y + side * half * 0.35,
        });
    }
  }
}

/** Two wheels of an axle. */
function axle(frame, x, radius, steered) {
  for (const side of [1, -1]) {
    const y = frame.y + side * (frame.width / 2 - 0.12);
    frame.parts.push({ kind: steered ? "steered" : "wheel", x, y, z: radius, radius, wide: 0.22 });
  }
}

/** Where the axles are: the rear one at the reference point, where that is below the body. */
function axles({ x, length, width }) {
  const rear = x > 0.1 * length ? 0 : x - 0.3 * length;
  return [rear, Math.min(rear + 0.6 * length, x + length / 2 - 0.15 * length), Math.min(0.34, width / 5)];
}

function sedan(frame) {
  const { mesh, width, at, y } = frame,
    half = width / 2,
    [back, bottom] = at(-0.5, 0.14),
    [front] = at(0.5, 0),
    [, waist] = at(0, 0.58),
    [, top] = at(0, 1);
  mesh.frustum([back, front, half, bottom], [back + 0.05, front - 0.12, half * 0.96, waist], OWN, { y });
  mesh.frustum(
    [at(-0.46, 0)[0], at(0.2, 0)[0], half * 0.9, waist],
    [at(-0.33, 0)[0], at(0.02, 0)[0], half * 0.7, top],
    OWN,
    {
      sides: paint("pane"),
      y,
    },
  );
  lamps(frame, at(0, 0.36)[1], at(0, 0.47)[1]);
  const [rear, ahead, radius] = axles(frame);
  axle(frame, rear, radius, false);
  axle(frame, ahead, radius, true);
}

/** Trucks, vans, buses, trailers and trains: a box, for trucks with a cab before it. */
function heavy(frame, category) {
  const { mesh, width, length, at, y } = frame,
    half = width / 2,
    [back, bottom] = at(-0.5, 0.18),
    [front, top] = at(0.5, 1),
    cab = category === "truck" || category === "semitrailer" ? Math.min(2.3, length * 0.3) : 0;
  const glass = (x0, x1, low, high) =>
    mesh.frustum([x0, x1, half * 1.01, at(0, low)[1]], [x0, x1, half * 1.01, at(0, high)[1]], paint("pane"), { y });
  if (cab) {
    mesh.frustum([back, front - cab - 0.15, half, bottom], [back, front - cab - 0.15, half, top], paint("wall"), { y });
    mesh.frustum([back, front, half * 0.6, bottom - 0.1], [back, front, half * 0.6, bottom + 0.1], DARK, { y });
    mesh.frustum([front - cab, front, half * 0.98, bottom], [front - cab, front - 0.15, half * 0.94, at(0, 0.88)[1]], OWN, {
      y,
    });
    glass(front - cab * 0.6, front + 0.01, 0.52, 0.76);
  } else if (category === "trailer") {
    mesh.frustum([back, front, half, bottom], [back, front, half, top], paint("wall"), { y });
  } else {
    const nose = category === "van" ? 0.14 * length : 0.1;
    mesh.frustum([back, front, half, bottom], [back, front - nose, half * 0.93, top], OWN, { y });
    if (category === "van") glass(front - length * 0.3, front - 0.55 * nose, 0.58, 0.85);
    else glass(back + 0.2, front - 0.04, 0.45, 0.8);
  }
  lamps(frame, at(0, 0.2)[1], at(0, 0.26)[1]);
  const [rear, ahead, usual] = axles(frame),
    radius = category === "van" ? usual : 0.48;
  axle(frame, rear, radius, false);
  if (length > 8) axle(frame, rear + 2.5 * radius, radius, false);
  if (category !== "trailer") axle(frame, ahead, radius, true);
}

function rider(frame, category) {
  const { mesh, x, y, length, at } = frame,
    motor = category === "motorbike",
    radius = Math.min(0.33, length / 5);
  const [back, front] = [x - length / 2 + radius, x + length / 2 - radius];
  for (const [place, kind] of [
    [back, "wheel"],
    [front, "steered"],
  ])
    frame.parts.push({ kind, x: place, y, z: radius, radius, wide: motor ? 0.14 : 0.05 });
  const wide = motor ? 0.16 : 0.04;
  mesh.frustum([back, front, wide, radius], [back + 0.2, front - 0.15, wide, radius + (motor ? 0.45 : 0.3)], OWN, { y });
  mesh.frustum([front - 0.15, front - 0.08, 0.3, radius + 0.65], [front - 0.15, front - 0.08, 0.3, radius + 0.7], DARK, {
    y,
  });
  mesh.frustum([front - 0.12, front, 0.03, radius], [front - 0.15, front - 0.1, 0.03, radius + 0.65], DARK, { y });
  if (motor) lamps({ ...frame, width: 0.5 }, at(0, 0.36)[1], at(0, 0.42)[1]);
  const seat = back + 0.32,
    hip = radius + 0.45;
  for (const side of [1, -1])
    mesh.frustum([seat, seat + 0.4, 0.07, radius], [seat - 0.05, seat + 0.15, 0.07, hip], DARK, { y: y + side * 0.12 });
  person(mesh, seat, y, hip, OWN, 0.22);
}

/** Trunk, arms and head above the hip. */
function person(mesh, x, y, hip, own, lean = 0.03) {
  mesh.frustum([x - 0.11, x + 0.11, 0.16, hip], [x - 0.11 + lean, x + 0.11 + lean, 0.21, hip + 0.56], own, { y });
  for (const side of [1, -1])
    mesh.frustum([x - 0.06, x + 0.06, 0.05, hip + 0.02], [x - 0.06 + lean, x + 0.06 + lean, 0.05, hip + 0.54], own, {
      y: y + side * 0.26,
    });
  mesh.column(x + lean + 0.03, y, 0.11, hip + 0.6, hip + 0.84, SKIN, { top: 0.1 });
}

function walker(frame) {
  const { mesh, x, y, low, height } = frame,
    hip = low + 0.5 * height;
  for (const side of [1, -1]) frame.parts.push({ kind: "leg", x, y: y + side * 0.1, z: hip, side, radius: hip - low });
  const grown = new Mesh();
  person(grown, 0, 0, 0, OWN);
  const scale = height / 2 / 0.84;
  for (let i = 0; i < grown.points.length; i += 3) {
    const [u, v, w] = grown.points.slice(i, i + 3).map(value => value * scale);
    grown.points.splice(i, 3, x + u, y + v, hip + w);
  }
  Object.assign(mesh, grown);
}

const SPOKE = [
  [0.1, -0.14],
  [0.66, -0.14],
  [0.66, 0.14],
  [0.1, 0.14],
];

/** A wheel of radius 1 and width 1 about its middle, and a leg of length 1 that hangs from its hip. */
function moving() {
  const wheel = new Mesh(),
    leg = new Mesh(),
    corners = 14;
  const rim = (r, side) =>
    Array.from({ length: corners }, (_, i) => {
      const angle = (2 * Math.PI * i) / corners;
      return [r * Math.cos(angle), side * 0.5, r * Math.sin(angle)];
    });
  const [left, right] = [rim(1, 1), rim(1, -1)];
  for (let i = 0; i < corners; i++) {
    const j = (i + 1) % corners;
    wheel.face([left[j], left[i], right[i], right[j]], paint("tyre"));
  }
  for (const side of [1, -1]) {
    wheel.face(side > 0 ? [...left].reverse() : right, paint("tyre"));
    for (let spoke = 0; spoke < 5; spoke++) {
      const angle = (2 * Math.PI * spoke) / 5;
      wheel.face(
        SPOKE.map(([u, v]) => [
          u * Math.cos(angle) - v * Math.sin(angle),
          side * 0.53,
          u * Math.sin(angle) + v * Math.cos(angle),
        ]),
        PALE,
      );
    }
  }
  leg.frustum([-0.05, 0.12, 0.06, -1], [-0.05, 0.09, 0.06, -0.9], DARK);
  leg.frustum([-0.07, 0.06, 0.07, -0.95], [-0.09, 0.09, 0.085, 0], DARK);
  return { wheel, leg };
}

/** Metres covered since a part of a track began, at each sample; kept with the part. */
function covered(part) {
  if (!part.covered) {
    part.covered = new Float64Array(part.x.length);
    for (let i = 1; i < part.x.length; i++)
      part.covered[i] = part.covered[i - 1] + Math.hypot(part.x[i] - part.x[i - 1], part.y[i] - part.y[i - 1]);
  }
  return part.covered;
}

/** A state with what a body needs: heights and tilts, metres covered, and how strongly the way bends (1/m). */
function motionAt(track, time, length) {
  const state = stateAt(track, time, length);
  if (!state) return null;
  const part = partAt(track.parts, time / length + 1e-6, each => each.x.length),
    i = Math.floor(time / length + 1e-6 - part.start),
    j = Math.min(i + 1, part.x.length - 1),
    f = time / length - part.start - i;
  const way = covered(part),
    mix = values => (values ? values[i] + (values[j] - values[i]) * f : 0);
  const [a, b] = [Math.max(0, i - 3), Math.min(part.x.length - 1, i + 3)],
    gone = way[b] - way[a];
  return Object.assign(state, {
    z: mix(part.z),
    pitch: mix(part.pitch),
    roll: mix(part.roll),
    way: mix(way) * (state.v < 0 ? -1 : 1),
    bend: gone > 0.05 ? (part.h[b] - part.h[a]) / gone : 0,
  });
}

/** Lit lamps of a vehicle: from the event log, and brake lights from its deceleration. */
function litOf(run, track, state, time) {
  const said = {};
  run.switched ??= run.events.filter(([, kind]) => kind === "light");
  for (const [since, , name, text] of run.switched)
    if (name === track.name && since <= time + 1e-6) {
      const [lamp, mode] = text.split(" ");
      said[lamp] = mode;
    }
  const flash = (time * FLASHES) % 1 < 0.5;
  const lit = (...names) => (names.some(name => said[name] === "on" || (said[name] === "flashing" && flash)) ? 1 : 0);
  const both = lit("warningLights") || (said.warningLights === "on" && flash);
  return [
    0,
    state.brakes || lit("brakeLights") ? 1 : 0,
    both || lit("indicatorLeft"),
    both || lit("indicatorRight"),
    lit("lowBeam", "highBeam", "daytimeRunningLights", "fogLightsFront") ? 1 : 0.4,
    state.v < -0.1 || lit("reversingLights") ? 1 : 0,
  ].map(Number);
}

/** Place and turn of a moving part of a participant. */
function partMatrix(part, model, { way, bend }, base) {
  const here = times(model, shifted(part.x, part.y, part.z));
  if (part.kind === "leg") {
    const swing = 0.45 * part.side * Math.sin((2 * Math.PI * way) / STRIDE);
    return times(times(here, turned(1, swing)), scaled(1, 1, part.radius));
  }
  const steered = part.kind === "steered" ? times(here, turned(2, Math.atan(base * bend))) : here;
  return times(times(steered, turned(1, way / part.radius)), scaled(part.radius, part.wide, part.radius));
}

const scaled = (x, y, z) => [x, 0, 0, 0, 0, y, 0, 0, 0, 0, z, 0, 0, 0, 0, 1];
