// One run in three dimensions: cameras, what is drawn, and how much of it a slow machine can draw.

/** Where all views look from; `on` where they are in three dimensions. Angles in rad, lengths in m. */
const eye = { on: false, kind: "chase", shadows: false, turn: 0, tilt: 0, away: 14, free: null };
const CAMERAS = [
  ["chase", "Chase camera"],
  ["driver", "Driver's camera"],
  ["free", "Free camera"],
];
const FIELD = { chase: 0.9, driver: 1.15, free: 0.95 }; // rad
/** What is drawn, up to which distance in m, and pixels per pixel of the screen: from everything to the least. */
const LEVELS = [
  { reach: 1500, fine: 600, near: 300, parts: 150, sharp: 2 },
  { reach: 900, fine: 300, near: 180, parts: 80, sharp: 1 },
  { reach: 500, fine: 180, near: 120, parts: 50, sharp: 0.75 },
  { reach: 300, fine: 120, near: 80, parts: 30, sharp: 0.5 },
];
const SLOW = 34; // ms between frames from which on less is drawn
const WATCHED = 15; // frames whose times are looked at
const STILL = { x: 0, y: 0, z: 0, h: 0, v: 0, pitch: 0, roll: 0 };

/** Look another way: `turn` and `tilt` by angles. */
function look3(turn, tilt) {
  const at = eye.kind === "free" ? eye.free : eye;
  const name = eye.kind === "free" ? "h" : "turn";
  at[name] += turn;
  at.tilt = Math.min(1.4, Math.max(eye.kind === "chase" ? -0.3 : -1.5, at.tilt + tilt));
}

/** Go nearer to what is followed, or ahead. */
function nearer(factor) {
  if (eye.kind === "chase") eye.away = Math.min(300, Math.max(4, eye.away / factor));
  else if (eye.kind === "free") move(Math.log(factor) * 2.5, 0, 0);
}

/** Move the free camera ahead, to the left and upwards, in steps that grow with its height. */
function move(ahead, left, up) {
  const { free } = eye;
  if (!free) return;
  const step = 2 + Math.abs(free.z - free.ground) * 0.15,
    [c, s] = [Math.cos(free.h), Math.sin(free.h)];
  free.x += (ahead * c - left * s) * step;
  free.y += (ahead * s + left * c) * step;
  free.z = Math.max(free.ground + 0.5, free.z + up * step);
}

class Space {
  /** A canvas below a view's own, which keeps the names; null without WebGL. */
  static of(view, roadData, steps) {
    const canvas = el("canvas", { class: "solid", "aria-hidden": "true" }),
      painter = new Painter(canvas);
    return painter.gl ? new Space(view, roadData, steps, canvas, painter) : null;
  }

  constructor(view, roadData, steps, canvas, painter) {
    Object.assign(this, { view, canvas, painter, level: 0, intervals: [], last: 0, seen: STILL });
    const { tiles, base } = roadData ? groundOf(roadData, steps) : { tiles: new Tiles(), base: -0.1 };
    this.tiles = tiles.kept(painter);
    this.base = base;
    this.disc = painter.keep(disc());
    const { wheel, leg } = moving();
    this.moving = { wheel: painter.keep(wheel), leg: painter.keep(leg) };
    this.signals = roadData ? roadData.signals.filter(signal => signal.dynamic) : [];
    this.lamps = painter.keep(lampsOfLight());
    this.bodies = view.run.tracks.map(track => {
      const { mesh, parts } = bodyOf(track);
      return { body: painter.keep(mesh), parts };
    });
  }

  /** Target of the camera: the view's participant, else the ego, else any that exists. */
  target() {
    const { run, followed } = this.view,
      ego = run.tracks.find(track => track.name === run.ego);
    for (const track of [followed, ego, ...run.tracks]) {
      const state = track && this.states[run.tracks.indexOf(track)];
      if (state) return { track, state };
    }
    return { track: followed || ego || run.tracks[0], state: this.seen };
  }

  /** The eye's place and direction. */
  camera(time) {
    const { track, state } = this.target(),
      box = track ? track.box : [0, 0, 4, 2, 0.75, 1.5];
    this.seen = state;
    const before =
      (track && stateAt(track, Math.max(0, Math.min(time, this.view.run.end) - 0.4), this.view.run.sample)) || state;
    if (eye.kind === "free") {
      if (!eye.free) this.release(before, state, box);
      return eye.free;
    }
    if (eye.kind === "driver") {
      const [ahead, aside, up] = [
        box[0] + box[2] * (HEAVY.has(track && track.category) ? 0.42 : 0.06),
        box[3] * 0.18,
        box[4] + box[5] * 0.3,
      ];
      const [c, s] = [Math.cos(state.h), Math.sin(state.h)],
        rise = up - ahead * Math.sin(state.pitch);
      const tilt = eye.tilt - state.pitch;
      return {
        x: state.x + ahead * c - aside * s,
        y: state.y + ahead * s + aside * c,
        z: state.z + rise,
        h: state.h + eye.turn,
        tilt,
      };
    }
    return this.behind(before.h, state, box);
  }

  behind(heading, state, box) {
    const h = heading + eye.turn,
      down = 0.3 + eye.tilt,
      [c, s] = [Math.cos(state.h), Math.sin(state.h)];
    const [x, y, z] = [state.x + box[0] * c - box[1] * s, state.y + box[0] * s + box[1] * c, state.z + box[4] + box[5] / 2];
    const flat = Math.cos(down) * eye.away;
    const up = Math.max(z + Math.sin(down) * eye.away, state.z + 0.6);
    return { x: x - Math.cos(h) * flat, y: y - Math.sin(h) * flat, z: up, h, tilt: -Math.atan2(up - z, flat) + 0.06 };
  }

  /** Let the free camera begin where the chase camera is, a little higher. */
  release(before, state, box) {
    const [turn, tilt, away] = [eye.turn, eye.tilt, eye.away];
    Object.assign(eye, { turn: 0, tilt: 0.15, away: 25 });
    eye.free = { ...this.behind(before.h, state, box), ground: state.z };
    Object.assign(eye, { turn, tilt, away });
  }

  draw(time) {
    const { canvas, painter, view } = this,
      { gl, at } = painter,
      { run } = view,
      moment = Math.min(time, run.end);
    this.watch();
    const level = LEVELS[this.level],
      ratio = Math.min(window.devicePixelRatio || 1, 2) * Math.min(level.sharp, 1);
    const [wide, high] = [canvas.clientWidth, canvas.clientHeight].map(size => Math.max(1, Math.round(size * ratio)));
    if (canvas.width !== wide || canvas.height !== high) Object.assign(canvas, { width: wide, height: high });
    gl.viewport(0, 0, wide, high);
    this.states = run.tracks.map(track => motionAt(track, moment, run.sample));
    const from = this.camera(time),
      reach = level.reach + Math.max(0, from.z - this.base) * 2;
    this.from = from;
    this.matrix = seenFrom(from, wide, high, FIELD[eye.kind], 0.5, reach * 1.6);
    const sky = rgb(view.colour("sky"));
    gl.clearColor(...sky, 1);
    gl.clear(gl.COLOR_BUFFER_BIT | gl.DEPTH_BUFFER_BIT | gl.STENCIL_BUFFER_BIT);
    gl.uniformMatrix4fv(at.view, false, this.matrix);
    gl.uniform3f(at.eye, from.x, from.y, from.z);
    gl.uniform3f(at.sky, ...sky);
    gl.uniform2f(at.haze, reach * 0.1, reach * 0.9);
    gl.uniform3f(at.shadow, 0, 0, 0);
    this.paints = PAINTS.map(name => rgb(name.startsWith("#") ? name : view.colour(name === "own" ? "car" : name)));
    gl.uniform3fv(at.paints, this.paints.flat());
    painter.light([0, 0, 0, 0, 0, 0]);
    painter.place(shifted(from.x, from.y, this.base));
    gl.depthMask(false); // below everything
    painter.draw(this.disc);
    gl.depthMask(true);
    painter.place(shifted(0, 0, 0));
    for (const tile of this.tiles) this.drawTile(tile, reach, level);
    this.drawLights(moment, level);
    const shown = this.visible(reach);
    if (eye.shadows) this.drawShadows(shown);
    for (const each of shown) this.drawBody(each, moment, level);
  }

  drawTile(tile, reach, level) {
    const away =
      Math.hypot(...tile.middle.map((value, i) => value - [this.from.x, this.from.y, this.from.z][i])) - tile.radius;
    if (away > reach || !this.inSight(tile.middle, tile.radius)) return;
    this.painter.draw(away < level.near ? tile.all : away < level.fine ? tile.fine : tile.coarse);
  }

  /** Whether a ball may be seen: beside none of four sides of the picture, nor behind the eye. */
  inSight([x, y, z], radius) {
    const m = this.matrix;
    const row = i => [m[i], m[i + 4], m[i + 8], m[i + 12]],
      last = row(3);
    for (const [i, sign] of [
      [0, 1],
      [0, -1],
      [1, 1],
      [1, -1],
    ]) {
      const [a, b, c, d] = row(i).map((value, k) => last[k] + sign * value);
      if (a * x + b * y + c * z + d < -radius * Math.hypot(a, b, c)) return false;
    }
    return last[0] * x + last[1] * y + last[2] * z + last[3] > -radius;
  }

  /** Participants that may be seen, with their places. */
  visible(reach) {
    const own = eye.kind === "driver" ? this.target().track : null;
    return this.view.run.tracks.flatMap((track, i) => {
      const state = this.states[i];
      if (!state || track === own) return [];
      const away = Math.hypot(state.x - this.from.x, state.y - this.from.y, state.z - this.from.z);
      if (away > reach || !this.inSight([state.x, state.y, state.z], track.box[2] + track.box[5])) return [];
      return [{ track, state, away, model: placed(state), ...this.bodies[i] }];
    });
  }

  drawBody({ track, state, away, model, body, parts }, time, level) {
    const { painter, view } = this;
    const touching = view.touching.has(track.name);
    painter.gl.uniform3f(painter.at.paints, ...rgb(view.colour(touching ? "bad" : look(track, view.run.ego))));
    painter.light(track.kind === "vehicle" ? litOf(view.run, track, state, time) : [0, 0, 0, 0, 0, 0]);
    painter.place(model);
    painter.draw(body);
    if (away > level.parts) return;
    for (const part of parts) {
      painter.place(partMatrix(part, model, state, 0.6 * track.box[2]));
      painter.draw(this.moving[part.kind === "leg" ? "leg" : "wheel"]);
    }
  }

  /** Bodies laid flat along the sun's rays, each place of the ground darkened once. */
  drawShadows(shown) {
    const { gl, at } = this.painter;
    gl.enable(gl.BLEND);
    gl.enable(gl.STENCIL_TEST);
    gl.stencilFunc(gl.NOTEQUAL, 1, 1);
    gl.stencilOp(gl.KEEP, gl.KEEP, gl.REPLACE);
    for (const { state, model, body } of shown) {
      const [c, s] = [Math.cos(state.h), Math.sin(state.h)];
      gl.uniform3f(at.shadow, (SUN[0] * c + SUN[1] * s) / SUN[2], (SUN[1] * c - SUN[0] * s) / SUN[2], 1);
      this.painter.place(model);
      this.painter.draw(body);
    }
    gl.uniform3f(at.shadow, 0, 0, 0);
    gl.disable(gl.STENCIL_TEST);
    gl.disable(gl.BLEND);
  }

  drawLights(time, level) {
    for (const signal of this.signals) {
      const { x, y, z, h } = signal;
      if (Math.hypot(x - this.from.x, y - this.from.y) > level.near) continue;
      const shown = (this.view.run.signals[signal.id] || []).findLast(([since]) => since <= time + 1e-6);
      const lit = lampsOn(shown ? shown[1] : "");
      this.painter.light([0, ...["red", "yellow", "green"].map(name => Number(lit.includes(name))), 0, 0]);
      this.painter.place(placed({ x, y, z: z + above(signal), h }));
      this.painter.draw(this.lamps);
    }
  }

  /** Draw less once frames take too long while everything moves. */
  watch() {
    const now = performance.now(),
      since = now - this.last;
    this.last = now;
    if (since > 400) this.intervals = [];
    else this.intervals.push(since);
    if (this.intervals.length < WATCHED + 5) return;
    const mean = this.intervals.slice(5).reduce((a, b) => a + b) / WATCHED;
    this.intervals = [];
    if (mean > SLOW && this.level < LEVELS.length - 1) this.level++;
  }

  /** What is left out on a slow machine, in words. */
  get told() {
    if (!this.level) return "";
    const { reach, sharp } = LEVELS[this.level];
    return `simplified: up to ${reach} m${sharp < 1 ? `, ${Math.round(100 * sharp)} % of the pixels` : ""}`;
  }

  /** A place in the world on the screen (CSS pixels), or null where it is not ahead. */
  project(x, y, z) {
    const m = this.matrix,
      [u, v, , w] = [0, 1, 2, 3].map(i => m[i] * x + m[i + 4] * y + m[i + 8] * z + m[i + 12]);
    const { clientWidth: width, clientHeight: height } = this.canvas;
    return w > 0.1 ? [((u / w + 1) * width) / 2, ((1 - v / w) * height) / 2, w] : null;
  }
}

/** Lamps of a traffic light: red, yellow, green from above. */
function lampsOfLight() {
  const mesh = new Mesh();
  ["#ff2a1a", "#f0be00", "#1fae54"].forEach((own, i) => {
    const ring = Array.from({ length: 12 }, (_, k) => [
      0.31,
      0.12 * Math.cos((2 * Math.PI * k) / 12),
      HOUSING - 0.2 - 0.3 * i + 0.12 * Math.sin((2 * Math.PI * k) / 12),
    ]);
    mesh.face(ring, paint(own), i + 1);
  });
  return mesh;
}
