// Roads, what stands beside them, and the ground, as meshes in square tiles.

const TILE = 200; // m
const LONGEST = 50; // m of a face along a road
const COARSE = 4; // of so many stations of a road one is enough far away
const LAYERS = { verge: 1, walk: 2, shoulder: 3, bike: 4, road: 5, flat: 6, mark: 7 };
const LIFT = 0.012; // m between layers; participants stand on that of roads
const lifted = layer => (layer - LAYERS.road) * LIFT;
const DEEP = 2; // m by which edges of roads reach down, where roads have heights
const UP = [0, 0, 1];
const ON_THE_ROAD = new Set(["293", "294", "295", "296", "297", "298", "299", "340", "341"]); // signs that are painted on it

/** Tiles by their place. */
class Tiles {
  constructor() {
    this.all = new Map();
  }

  /** The tile of a place: a mesh with three lists of faces, and how far it reaches. */
  at(x, y) {
    const key = `${Math.floor(x / TILE)} ${Math.floor(y / TILE)}`;
    let tile = this.all.get(key);
    if (!tile) this.all.set(key, (tile = { mesh: new Mesh(), near: [], fine: [], coarse: [] }));
    return tile;
  }

  /** Add what a function adds to a tile's mesh; it is seen from nearby only. */
  stand(x, y, add) {
    const tile = this.at(x, y);
    add(tile.mesh);
    tile.near.push(...tile.mesh.faces.splice(0));
  }

  /** Send them to the graphics card. */
  kept(painter) {
    return [...this.all.values()].map(({ mesh, near, fine, coarse }) => {
      const [low, high] = [[0, 1, 2].map(() => Infinity), [0, 1, 2].map(() => -Infinity)];
      mesh.points.forEach((value, i) => {
        low[i % 3] = Math.min(low[i % 3], value);
        high[i % 3] = Math.max(high[i % 3], value);
      });
      mesh.faces = near.concat(fine, coarse);
      const { array } = painter.keep(mesh);
      return {
        middle: low.map((value, i) => (value + high[i]) / 2),
        radius: Math.hypot(...low.map((value, i) => high[i] - value)) / 2,
        all: { array, from: 0, count: near.length + fine.length },
        fine: { array, from: near.length, count: fine.length },
        coarse: { array, from: near.length + fine.length, count: coarse.length },
      };
    });
  }
}

/** Meshes of a road network. */
function groundOf(road, steps) {
  const tiles = new Tiles(),
    surfaces = road.surfaces.map(({ look, lines }) => [look, unpackLines(lines, steps.length)]);
  const hilly = surfaces.some(([, rings]) => rings.some(({ z }) => z));
  for (const [look, rings] of surfaces) for (const ring of rings) addStrip(tiles, ring, look, hilly);
  for (const { pattern, colour, width, lines } of road.marks)
    for (const line of unpackLines(lines, steps.length)) {
      const own = paint(pattern === "unmarked" ? "unmarked" : MARK_COLOURS[colour] || "mark");
      for (const dash of dashes(split(line), DASHES[pattern])) addRibbon(tiles, dash, Math.max(width, 0.1) / 2, own);
    }
  for (const { look, lines, heights } of road.objects) {
    if (look === "covered") continue;
    const tall = unpack(heights, 1, 0.1);
    unpackLines(lines, steps.length).forEach((ring, i) => addObject(tiles, ring, tall[i], look));
  }
  for (const signal of road.signals) addSignal(tiles, signal);
  const field = hilly ? new Heights(surfaces.flatMap(([, rings]) => rings)) : null;
  if (field) field.add(tiles);
  return { tiles, base: field ? field.lowest - 1 : -0.1 };
}

/** A line's points [x, y, z] without long stretches. */
function split({ x, y, z }, longest = LONGEST) {
  const found = [];
  for (let i = 0; i < x.length; i++) {
    const here = [x[i], y[i], z ? z[i] : 0],
      before = found[found.length - 1];
    if (before) {
      const count = Math.ceil(Math.hypot(here[0] - before[0], here[1] - before[1]) / longest);
      for (let k = 1; k < count; k++) found.push(before.map((value, axis) => value + ((here[axis] - value) * k) / count));
    }
    found.push(here);
  }
  return found;
}

/** Both borders of a lane, with long stretches cut alike. */
function bordersOf({ x, y, z }, longest) {
  const count = x.length / 2,
    left = [],
    right = [];
  const at = i => [x[i], y[i], z ? z[i] : 0];
  for (let i = 0; i < count; i++) {
    const [a, b] = [at(i), at(2 * count - 1 - i)];
    if (i) {
      const [p, q] = [left[left.length - 1], right[right.length - 1]];
      const long = Math.max(Math.hypot(a[0] - p[0], a[1] - p[1]), Math.hypot(b[0] - q[0], b[1] - q[1]));
      const pieces = Math.ceil(long / longest);
      for (let k = 1; k < pieces; k++) {
        left.push(p.map((value, axis) => value + ((a[axis] - value) * k) / pieces));
        right.push(q.map((value, axis) => value + ((b[axis] - value) * k) / pieces));
      }
    }
    left.push(a);
    right.push(b);
  }
  return [left, right];
}

/** A lane as a strip of faces, cut at the borders of tiles. */
function addStrip(tiles, ring, look, hilly) {
  const [left, right] = bordersOf(ring, LONGEST),
    own = paint(look),
    layer = LAYERS[look];
  const tileOf = i => tiles.at((left[i][0] + right[i + 1][0]) / 2, (left[i][1] + right[i + 1][1]) / 2);
  for (let begin = 0, end; begin < left.length - 1; begin = end) {
    const tile = tileOf(begin),
      { mesh } = tile,
      first = mesh.size;
    end = begin + 1;
    while (end < left.length - 1 && tileOf(end) === tile) end++;
    for (let i = begin; i <= end; i++)
      for (const [x, y, z] of [left[i], right[i]]) mesh.point(x, y, z + lifted(layer), UP, own, 0, layer);
    const between = (list, i, j) => {
      const [a, b] = [first + 2 * (i - begin), first + 2 * (j - begin)];
      list.push(a, a + 1, b, a + 1, b + 1, b);
    };
    for (let i = begin; i < end; i++) between(tile.fine, i, i + 1);
    for (let i = begin; i < end; i += COARSE) between(tile.coarse, i, Math.min(end, i + COARSE));
    if (hilly) for (const side of [left, right]) addEdge(tile, side.slice(begin, end + 1));
  }
}

/** The side of a road that lies higher than the ground. */
function addEdge({ mesh, near }, side) {
  for (let i = 0; i < side.length - 1; i++) {
    const [a, b] = [side[i], side[i + 1]];
    mesh.face([a, b, [b[0], b[1], b[2] - DEEP], [a[0], a[1], a[2] - DEEP]], paint("wall"));
  }
  near.push(...mesh.faces.splice(0));
}

/** The dashes of a line, or all of it. */
function dashes(points, pattern) {
  if (!pattern) return [points];
  const [on, off] = pattern,
    found = [];
  let left = on,
    dash = [points[0]];
  for (let i = 1; i < points.length; i++) {
    let from = points[i - 1];
    for (;;) {
      const long = Math.hypot(points[i][0] - from[0], points[i][1] - from[1]);
      if (long < left) {
        left -= long;
        if (dash) dash.push(points[i]);
        break;
      }
      const share = left / long;
      from = from.map((value, axis) => value + (points[i][axis] - value) * share);
      if (dash) found.push([...dash, from]);
      dash = dash ? null : [from];
      left = dash ? on : off;
    }
  }
  if (dash && dash.length > 1) found.push(dash);
  return found;
}

/** A line of some width on the road. */
function addRibbon(tiles, points, half, own) {
  const layer = LAYERS.mark;
  for (let begin = 0; begin < points.length - 1; begin += 8) {
    const end = Math.min(points.length - 1, begin + 8),
      tile = tiles.at(points[begin][0], points[begin][1]),
      first = tile.mesh.size;
    for (let i = begin; i <= end; i++) {
      const [a, b] = [points[Math.max(0, i - 1)], points[Math.min(points.length - 1, i + 1)]];
      const long = Math.hypot(b[0] - a[0], b[1] - a[1]) || 1,
        [u, v] = [(-(b[1] - a[1]) / long) * half, ((b[0] - a[0]) / long) * half];
      const [x, y, z] = points[i];
      for (const side of [1, -1]) tile.mesh.point(x + side * u, y + side * v, z + lifted(layer), UP, own, 0, layer);
    }
    for (let i = 0; i < end - begin; i++) {
      const a = first + 2 * i;
      tile.near.push(a, a + 1, a + 2, a + 1, a + 3, a + 2);
    }
  }
}

/** Triangles of a simple polygon's corners [x, y], by cutting ears. */
function triangles(corners) {
  const area = corners.reduce((sum, [x, y], i) => {
    const [u, v] = corners[(i + 1) % corners.length];
    return sum + x * v - u * y;
  }, 0);
  const left = corners.map((_, i) => i),
    found = [];
  if (area < 0) left.reverse();
  const side = (a, b, c) => (b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0]);
  let misses = 0;
  for (let i = 0; left.length > 3 && misses <= left.length; i++) {
    const at = k => left[(i + k) % left.length],
      [a, b, c] = [0, 1, 2].map(k => corners[at(k)]);
    const inside = k => side(a, b, corners[k]) >= 0 && side(b, c, corners[k]) >= 0 && side(c, a, corners[k]) >= 0;
    const others = left.filter(k => k !== at(0) && k !== at(1) && k !== at(2));
    if (side(a, b, c) > 0 && !others.some(inside)) {
      found.push(at(0), at(1), at(2));
      left.splice((i + 1) % left.length, 1);
      misses = 0;
    } else misses++;
  }
  for (let i = 2; i < left.length; i++) found.push(left[0], left[i - 1], left[i]);
  return found;
}

const OBJECTS = { tree: "leaf", building: "wall", flat: "unmarked", crosswalk: "mark" };

/** An object by its outline and height; what is flat lies on the road. */
function addObject(tiles, ring, height, look) {
  const corners = Array.from(ring.x, (x, i) => [x, ring.y[i], ring.z ? ring.z[i] : 0]),
    own = paint(OBJECTS[look] || "thing");
  const middle = [0, 1, 2].map(axis => corners.reduce((sum, each) => sum + each[axis], 0) / corners.length);
  tiles.stand(middle[0], middle[1], mesh => {
    if (look === "tree") return addTree(mesh, middle, corners, height);
    if (look === "crosswalk" && corners.length === 4) return addZebra(mesh, corners, own);
    const layer = height ? 0 : LAYERS.flat,
      top = corners.map(([x, y, z]) => [x, y, z + height + (height ? 0 : lifted(layer))]),
      first = mesh.size;
    for (const [x, y, z] of top) mesh.point(x, y, z, UP, own, 0, layer);
    mesh.faces.push(...triangles(corners).map(i => first + i));
    if (height)
      corners.forEach((here, i) => {
        const j = (i + 1) % corners.length;
        mesh.face([here, corners[j], top[j], top[i]], own);
      });
  });
}

function addTree(mesh, [x, y, z], corners, height) {
  const radius = Math.max(0.28 * height, Math.hypot(corners[0][0] - x, corners[0][1] - y));
  mesh.column(x, y, 0.05 * height, z, z + 0.35 * height, paint("tyre"), { corners: 5 });
  mesh.column(x, y, radius, z + 0.25 * height, z + height, paint("leaf"), { top: 0 });
}

/** Stripes across the longer way of a crosswalk. */
function addZebra(mesh, corners, own) {
  const away = (a, b) => Math.hypot(a[0] - b[0], a[1] - b[1]);
  const [a, b, c, d] =
    away(corners[0], corners[1]) >= away(corners[1], corners[2]) ? corners : [...corners.slice(1), corners[0]];
  const count = Math.max(1, Math.round(away(a, b))) * 2 - 1,
    on = (p, q, share) => p.map((value, axis) => value + (q[axis] - value) * share + (axis === 2 ? lifted(LAYERS.flat) : 0));
  for (let i = 0; i < count; i += 2) {
    const [from, to] = [i / count, (i + 1) / count];
    mesh.face([on(a, b, from), on(a, b, to), on(d, c, to), on(d, c, from)], own, 0, LAYERS.flat);
  }
}

// signals ------------------------------------------------------------------------------------

const HOUSING = 1.0; // m of a traffic light

/** Height of a signal's lower edge above its foot, m. */
const above = ({ up, dynamic }) => (up >= 0.5 ? up : dynamic ? 3 : 2);

/** A post with a plate, or with a traffic light, whose lamps are drawn later. */
function addSignal(tiles, signal) {
  const { x, y, z, h, both, dynamic, type } = signal;
  if (!dynamic && ON_THE_ROAD.has(type)) return;
  const low = z + above(signal),
    [c, s] = [Math.cos(h), Math.sin(h)];
  tiles.stand(x, y, mesh => {
    mesh.column(x, y, 0.06, z, low + (dynamic ? HOUSING : 0.6), paint("thing"), { corners: 6 });
    const at = (ahead, aside, up) => [x + ahead * c - aside * s, y + ahead * s + aside * c, low + up];
    if (dynamic) {
      const base = [
        [0.3, 0.18],
        [0.08, 0.18],
        [0.08, -0.18],
        [0.3, -0.18],
      ];
      base.forEach((u, i) => {
        const v = base[(i + 1) % 4];
        mesh.face([at(...u, 0), at(...v, 0), at(...v, HOUSING), at(...u, HOUSING)], paint("#24292f"));
      });
      return;
    }
    for (const front of both ? [1, -1] : [1])
      addPlate(mesh, (aside, up, out) => at(front * (0.07 + out), front * aside, up), type);
    if (!both) addPlate(mesh, (aside, up) => at(0.065, aside, up), type, paint("thing"));
  });
}

/** A sign's form and colours, by the numbers that most catalogues share: warnings, rules, directions. */
function plate(type) {
  if (type === "206") return { corners: 8, turn: Math.PI / 8, rim: "#e0483d", inner: "#e0483d" };
  if (type === "205") return { corners: 3, turn: -Math.PI / 2, rim: "#e0483d", inner: "#f4f6f8" };
  if (/^1\d\d/.test(type)) return { corners: 3, turn: Math.PI / 2, rim: "#e0483d", inner: "#f4f6f8" };
  if (/^(20[89]|21\d|22\d|23\d|24\d)/.test(type)) return { corners: 16, turn: 0, rim: "#f4f6f8", inner: "#4a90ff" };
  if (/^2\d\d/.test(type)) return { corners: 16, turn: 0, rim: "#e0483d", inner: "#f4f6f8" };
  return { corners: 4, turn: Math.PI / 4, rim: "#f4f6f8", inner: "#4a90ff" };
}

function addPlate(mesh, at, type, plain) {
  const { corners, turn, rim, inner } = plate(type);
  const ring = (radius, out) =>
    Array.from({ length: corners }, (_, i) => {
      const angle = turn + (2 * Math.PI * i) / corners;
      return at(radius * Math.cos(angle), 0.4 + radius * Math.sin(angle), out);
    });
  mesh.face(ring(0.4, 0), plain ?? paint(rim));
  if (plain === undefined) mesh.face(ring(0.29, 0.01), paint(inner));
}

// ground with heights ------------------------------------------------------------------------

const AROUND = 300; // m of ground beyond the roads
const CELLS = 400; // along the longer side, at most

/** Heights of the ground between roads: nowhere above a road, under bridges as deep as the lower one. */
class Heights {
  constructor(rings) {
    let [west, south, east, north] = [Infinity, Infinity, -Infinity, -Infinity];
    for (const { x, y } of rings)
      for (let i = 0; i < x.length; i++) {
        [west, east] = [Math.min(west, x[i]), Math.max(east, x[i])];
        [south, north] = [Math.min(south, y[i]), Math.max(north, y[i])];
      }
    this.cell = Math.max(6, (Math.max(east - west, north - south) + 2 * AROUND) / CELLS);
    Object.assign(this, { west: west - AROUND, south: south - AROUND });
    this.wide = Math.ceil((east - this.west + AROUND) / this.cell) + 1;
    this.high = Math.ceil((north - this.south + AROUND) / this.cell) + 1;
    this.z = new Float32Array(this.wide * this.high).fill(Infinity);
    for (const ring of rings) {
      const [left, right] = bordersOf(ring, this.cell / 2);
      left.forEach((a, i) => {
        const b = right[i],
          count = Math.ceil(Math.hypot(b[0] - a[0], b[1] - a[1]) / (this.cell / 2)) + 1;
        for (let k = 0; k <= count; k++) this.press(a.map((value, axis) => value + ((b[axis] - value) * k) / count));
      });
    }
    this.z = filled(this.z, this.wide, this.high);
    this.lowest = this.z.reduce((a, b) => Math.min(a, b));
  }

  /** Push the ground below a place. */
  press([x, y, z]) {
    const [i, j] = [Math.floor((x - this.west) / this.cell), Math.floor((y - this.south) / this.cell)];
    for (const at of [j * this.wide + i, j * this.wide + i + 1, (j + 1) * this.wide + i, (j + 1) * this.wide + i + 1])
      this.z[at] = Math.min(this.z[at], z - 0.05);
  }

  add(tiles) {
    const { wide, high, cell, z } = this,
      numbers = new Map();
    const number = (tile, i, j) => {
      const key = j * wide + i,
        own = numbers.get(tile) || numbers.set(tile, new Map()).get(tile);
      if (!own.has(key)) {
        const slope = (a, b) => (z[a] - z[b]) / (2 * cell),
          [l, r] = [Math.max(0, i - 1), Math.min(wide - 1, i + 1)],
          [d, u] = [Math.max(0, j - 1), Math.min(high - 1, j + 1)];
        const [a, b] = [slope(j * wide + l, j * wide + r), slope(d * wide + i, u * wide + i)],
          long = Math.hypot(a, b, 1);
        const normal = [a / long, b / long, 1 / long];
        own.set(key, tile.mesh.point(this.west + i * cell, this.south + j * cell, z[key], normal, paint("ground")));
      }
      return own.get(key);
    };
    for (let j = 0; j < high - 1; j++)
      for (let i = 0; i < wide - 1; i++) {
        const tile = tiles.at(this.west + (i + 0.5) * cell, this.south + (j + 0.5) * cell);
        const [a, b, c, d] = [
          number(tile, i, j),
          number(tile, i + 1, j),
          number(tile, i + 1, j + 1),
          number(tile, i, j + 1),
        ];
        for (const list of [tile.fine, tile.coarse]) list.push(a, b, c, a, c, d);
      }
  }
}

/** A grid whose infinite places get means of their surroundings: the same of a grid of half the size. */
function filled(z, wide, high) {
  if (!z.includes(Infinity)) return z;
  const [w, h] = [Math.ceil(wide / 2), Math.ceil(high / 2)];
  if (w === wide && h === high) return z.fill(0);
  const sum = new Float32Array(w * h),
    count = new Float32Array(w * h);
  z.forEach((value, at) => {
    if (value === Infinity) return;
    const coarse = (Math.floor(at / wide) >> 1) * w + ((at % wide) >> 1);
    sum[coarse] += value;
    count[coarse]++;
  });
  const less = filled(
    sum.map((value, i) => (count[i] ? value / count[i] : Infinity)),
    w,
    h,
  );
  const at = (i, j) => less[Math.min(h - 1, Math.max(0, j)) * w + Math.min(w - 1, Math.max(0, i))];
  return z.map((value, index) => {
    if (value !== Infinity) return value;
    const [x, y] = [((index % wide) - 0.5) / 2, (Math.floor(index / wide) - 0.5) / 2],
      [i, j] = [Math.floor(x), Math.floor(y)],
      [u, v] = [x - i, y - j];
    return (at(i, j) * (1 - u) + at(i + 1, j) * u) * (1 - v) + (at(i, j + 1) * (1 - u) + at(i + 1, j + 1) * u) * v;
  });
}

/** Flat ground around an eye, so large that its edge is never seen. */
function disc() {
  const mesh = new Mesh(),
    sectors = 32;
  mesh.point(0, 0, 0, UP, paint("ground"));
  for (const radius of [20, 60, 150, 350, 700, 1200, 2000, 4000])
    for (let i = 0; i < sectors; i++) {
      const angle = (2 * Math.PI * i) / sectors,
        here = mesh.point(radius * Math.cos(angle), radius * Math.sin(angle), 0, UP, paint("ground")),
        next = here - i + ((i + 1) % sectors);
      if (radius === 20) mesh.faces.push(0, here, next);
      else mesh.faces.push(here - sectors, here, next, here - sectors, next, next - sectors);
    }
  return mesh;
}
