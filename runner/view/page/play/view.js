// One run from above. All views share one camera, so that two runs are seen alike.

const NEAREST = 200,
  FARTHEST = 0.02; // px per m

/** Following the ego and its partner, or all participants; a participant's name is never a symbol. */
const BOTH = Symbol("both");
const ALL = Symbol("all");
const NAMED = 150; // m up to which names are shown in three dimensions
const CROWDED = 30; // px by which a name is moved at most, in three dimensions
const TURN = 0.006; // rad that a pixel turns the eye
const EASE = 0.2; // part of the way that the camera goes to a new scale in a frame

/** Where all views look: at a participant (plus an offset), several (`closer` than they need), or a place; m, px per m. */
const camera = { follow: null, x: 0, y: 0, dx: 0, dy: 0, scale: 6, closer: 1 };

function zoom(factor) {
  const before = camera.scale;
  camera.scale = Math.min(NEAREST, Math.max(FARTHEST, camera.scale * factor));
  camera.closer *= camera.scale / before;
}

function follow(name) {
  Object.assign(camera, { follow: name, dx: 0, dy: 0, closer: 1 });
}

const several = () => camera.follow === BOTH || camera.follow === ALL;

/** Keep the followed participants of all views in sight; `still` moves there at once. */
function aim(views, still) {
  const scales = several() ? views.filter(view => view.framed).map(view => view.framed.scale) : [];
  if (!scales.length) return;
  const goal = Math.min(...scales) * camera.closer;
  camera.scale = still ? goal : camera.scale * (goal / camera.scale) ** EASE;
}

const ABOVE = "from above; + and - zoom, drag to move";

class View {
  constructor(run, road, index, changed) {
    Object.assign(this, { index, changed, labels: true, colour: palette(), middle: [0, 0] });
    this.canvas = el("canvas", { tabindex: 0, role: "img" });
    this.show(run, road);
    this.told = el("span");
    this.pointers = new Map();
    this.canvas.addEventListener("pointerdown", event => this.press(event));
    this.canvas.addEventListener("pointermove", event => this.move(event));
    for (const name of ["pointerup", "pointercancel"]) this.canvas.addEventListener(name, event => this.release(event));
    this.canvas.addEventListener("wheel", event => this.wheel(event), { passive: false });
    this.canvas.addEventListener("dblclick", () => {
      if (eye.on) Object.assign(eye, { turn: 0, tilt: 0, away: 14, free: null });
      else this.fit();
      changed();
    });
    this.canvas.addEventListener("contextmenu", event => {
      if (eye.on) event.preventDefault(); // the right button moves the free camera
    });
  }

  /** Show a run, in the place of the one before. */
  show(run, road) {
    Object.assign(this, { run, road });
    this.canvas.setAttribute("aria-label", `${run.name} ${ABOVE}`);
  }

  /** Whom the camera follows, where this run has them. */
  get followed() {
    if (camera.follow === null) return null;
    const name = camera.follow === "" || camera.follow === BOTH ? this.run.ego : camera.follow;
    return this.run.tracks.find(track => track.name === name) || null;
  }

  /** Look up all states at a time, and the frame that holds ego and partner, or all participants. */
  place(time) {
    const { run } = this,
      at = Math.min(time, run.end);
    this.states = run.tracks.map(track => stateAt(track, at, run.sample));
    const name = during(run.partners, at, run.sample);
    const indices = [run.ego, name].map(each => run.tracks.findIndex(track => track.name === each));
    this.pair = indices.every(i => i >= 0 && this.states[i]) ? indices : null;
    const { clientWidth: width, clientHeight: height } = this.canvas,
      seen = camera.follow === ALL ? [...run.tracks.keys()].filter(i => this.states[i]) : this.pair || [],
      of = values => seen.map(i => values[i]);
    this.framed = seen.length ? framing(of(run.tracks), of(this.states), width, height) : null;
  }

  /** The whole paths of all participants. */
  fit() {
    let [west, east, south, north] = [Infinity, -Infinity, Infinity, -Infinity];
    for (const { parts } of this.run.tracks)
      for (const { x, y } of parts)
        for (let i = 0; i < x.length; i++) {
          west = Math.min(west, x[i]);
          east = Math.max(east, x[i]);
          south = Math.min(south, y[i]);
          north = Math.max(north, y[i]);
        }
    if (west > east) [west, east, south, north] = [-50, 50, -50, 50];
    const { clientWidth: width, clientHeight: height } = this.canvas;
    camera.scale = Math.min(width / (east - west + 20), height / (north - south + 20), 12);
    Object.assign(camera, { follow: null, x: (west + east) / 2, y: (south + north) / 2 });
  }

  draw(time) {
    const { ctx, width, height, ratio } = fitted(this.canvas),
      { scale } = camera,
      { run, colour } = this;
    const at = Math.min(time, run.end),
      { states, followed } = this,
      over = time > run.end + 1e-6;
    this.touching = new Set(run.collisions.filter(c => c.from <= at && at <= c.to).flatMap(c => c.who));
    if (eye.on) {
      this.space.draw(time);
      if (this.written || !this.flown) ctx.clearRect(0, 0, width, height); // clearing costs as much as drawing
      this.written = this.labels && this.drawNames(ctx, width, height);
      this.flown = true;
      return this.tell(at, over);
    }
    this.flown = false;
    const target = followed && states[run.tracks.indexOf(followed)];
    if (several() && this.framed) this.middle = [this.framed.middle[0] + camera.dx, this.framed.middle[1] + camera.dy];
    else if (target) this.middle = [target.x + camera.dx, target.y + camera.dy];
    else if (!followed) this.middle = [camera.x, camera.y];
    const [x, y] = this.middle;
    ctx.clearRect(0, 0, width, height);
    ctx.save();
    ctx.setTransform(scale * ratio, 0, 0, -scale * ratio, (width / 2 - x * scale) * ratio, (height / 2 + y * scale) * ratio);
    if (this.road) drawRoad(ctx, this.road, colour, scale);
    this.drawWays(ctx, scale);
    if (this.road) drawSignals(ctx, this.road, run.signals, at, colour, scale);
    run.tracks.forEach((track, i) => {
      const marked = this.touching.has(track.name)
        ? colour("bad")
        : track === followed && track.name !== run.ego && !several()
          ? colour("accent")
          : null;
      if (states[i]) drawParticipant(ctx, track, states[i], colour, look(track, run.ego), scale, marked);
    });
    ctx.restore();
    this.taken = [];
    this.drawPair(ctx, at, width, height);
    if (this.labels) this.drawLabels(ctx, width, height, scale);
    drawScale(ctx, scale, height, colour);
    return this.tell(at, over);
  }

  /** Names above participants in three dimensions, the nearest ones first; whether there are any. */
  drawNames(ctx, width, height) {
    const { space, run } = this,
      own = eye.kind === "driver" ? space.target().track : null,
      partner = this.pair ? run.tracks[this.pair[1]] : null;
    const found = run.tracks.flatMap((track, i) => {
      const state = this.states[i] && track !== own ? space.states[i] : null,
        at = state && space.project(state.x, state.y, state.z + track.box[4] + track.box[5] / 2 + 0.3);
      return at && at[2] < NAMED ? [{ track, state, at }] : [];
    });
    this.taken = [];
    for (const { track, state, at } of found.sort((a, b) => a.at[2] - b.at[2])) {
      const bold = track.name === run.ego || track === this.followed || track === partner,
        text = bold ? `${track.name} ${state.v.toFixed(1)} m/s` : track.name,
        [x, y] = at;
      if (x < 0 || x > width || y < 14 || y > height) continue;
      const line = this.free(x, y, text.length * 7);
      if (bold || y - line < CROWDED) drawLabel(ctx, text, x, line, this.colour, bold);
    }
    return this.taken.length > 0;
  }

  /** The lowest line above a place that no other name takes (pixels); it is taken from now on. */
  free(x, y, wide) {
    let line = y;
    while (this.taken.some(([a, b, w]) => Math.abs(a - x) < (w + wide) / 2 && Math.abs(b - line) < 14)) line -= 14;
    this.taken.push([x, line, wide]);
    return line;
  }

  drawWays(ctx, scale) {
    for (const track of this.run.tracks) {
      const ego = track.name === this.run.ego;
      ctx.strokeStyle = ego ? this.colour("ego") : this.colour("way");
      ctx.globalAlpha = ego ? 0.45 : 1;
      ctx.lineWidth = (ego ? 2 : 1) / scale;
      ctx.stroke(track.way);
    }
    ctx.globalAlpha = 1;
  }

  /** Names, each above its participant, and above the names that are there already. */
  drawLabels(ctx, width, height, scale) {
    const partner = this.pair ? this.run.tracks[this.pair[1]] : null;
    const crowded = scale < 3 && this.run.tracks.length > 8;
    this.run.tracks.forEach((track, i) => {
      const state = this.states[i],
        own = track.name === this.run.ego || track === this.followed || track === partner;
      if (!state || (crowded && !own)) return;
      const [x, y] = this.toScreen(state.x, state.y, width, height);
      const [ahead, , length, broad] = track.box,
        [cos, sin] = [Math.cos(state.h), Math.sin(state.h)];
      const above = Math.max(10, (ahead * sin + (Math.abs(sin) * length) / 2 + (Math.abs(cos) * broad) / 2) * scale + 6);
      const text = own ? `${track.name} ${state.v.toFixed(1)} m/s` : track.name;
      if (x < -50 || x > width + 50 || y < -20 || y > height + 20) return;
      drawLabel(ctx, text, x, this.free(x, y - above, text.length * 7), this.colour, own);
    });
  }

  /** The line between ego and partner with its length and, where the partner is ahead in the lane, the time to collision. */
  drawPair(ctx, at, width, height) {
    if (!this.pair) return;
    const { run } = this,
      [a, b] = this.pair;
    const both = [a, b].map(i => run.tracks[i].name);
    if (run.collisions.some(({ from, to, who }) => from <= at && at <= to && both.every(name => who.includes(name)))) return;
    const line = between(run.tracks[a], this.states[a], run.tracks[b], this.states[b]);
    const [[x, y], [u, v]] = [line.from, line.to].map(([p, q]) => this.toScreen(p, q, width, height));
    ctx.setLineDash([5, 4]);
    for (const [stroke, wide] of [
      ["halo", 4],
      ["text", 1.6],
    ]) {
      ctx.strokeStyle = this.colour(stroke);
      ctx.lineWidth = wide;
      ctx.beginPath();
      ctx.moveTo(x, y);
      ctx.lineTo(u, v);
      ctx.stroke();
    }
    ctx.setLineDash([]);
    const ttc =
      run.ttc && during(run.leads, at, run.sample) === run.tracks[b].name ? valueAt(run.ttc, at, run.sample) : null;
    const text = `${line.length.toFixed(1)} m${ttc === null ? "" : `, TTC ${ttc.toFixed(1)} s`}`;
    const fits = Math.abs(u - x) > text.length * 7 || Math.abs(v - y) > 36;
    const around = [a, b].flatMap(i => corners(run.tracks[i], this.states[i]));
    const ends = around.map(([p, q]) => this.toScreen(p, q, width, height)[1]);
    const place = [(x + u) / 2, fits ? (y + v) / 2 + 18 : Math.max(...ends) + 14];
    this.taken.push([...place, text.length * 7]);
    drawLabel(ctx, text, ...place, this.colour, true);
  }

  tell(at, over) {
    const touching = this.run.collisions
      .filter(c => c.from <= at && at <= c.to)
      .map(c => `collision: ${c.who.join(" and ")}`);
    const less = eye.on && this.space.told ? [this.space.told] : [];
    const text = [...touching, ...(over ? [`ended at ${seconds(this.run.end)}`] : []), ...less].join(", ");
    this.told.className = touching.length ? "bad" : "";
    if (this.told.textContent !== text) this.told.textContent = text;
  }

  toScreen(x, y, width, height) {
    return [width / 2 + (x - this.middle[0]) * camera.scale, height / 2 - (y - this.middle[1]) * camera.scale];
  }

  // pointers ----------------------------------------------------------------------------------

  press(event) {
    this.canvas.setPointerCapture(event.pointerId);
    this.pointers.set(event.pointerId, [event.clientX, event.clientY]);
    this.moved = 0;
    this.canvas.classList.add("dragged");
  }

  move(event) {
    const before = this.pointers.get(event.pointerId);
    if (!before) return;
    const now = [event.clientX, event.clientY],
      dx = now[0] - before[0],
      dy = now[1] - before[1];
    if (this.pointers.size === 2) {
      const other = [...this.pointers].find(([id]) => id !== event.pointerId)[1];
      const apart = p => Math.hypot(p[0] - other[0], p[1] - other[1]);
      (eye.on ? nearer : zoom)(apart(now) / Math.max(apart(before), 1));
    }
    const shift = event.shiftKey || event.buttons === 2 || this.pointers.size === 2;
    if (!eye.on) this.pan(-dx / this.pointers.size, dy / this.pointers.size);
    else if (shift && eye.kind === "free") move(dy * 0.05, dx * 0.05, 0);
    else look3(dx * TURN * (eye.kind === "chase" ? -1 : 1), dy * TURN);
    this.moved += Math.abs(dx) + Math.abs(dy);
    this.pointers.set(event.pointerId, now);
    this.changed();
  }

  release(event) {
    this.pointers.delete(event.pointerId);
    this.canvas.classList.remove("dragged");
    if (event.type === "pointerup" && this.moved < 4) this.pick(event);
  }

  /** Move the camera by pixels, to the right and up. */
  pan(right, up) {
    const [x, y] = camera.follow === null ? ["x", "y"] : ["dx", "dy"];
    camera[x] += right / camera.scale;
    camera[y] += up / camera.scale;
  }

  /** Follow the participant at the pointer. */
  pick(event) {
    const { left, top, width, height } = this.canvas.getBoundingClientRect();
    let best = 20,
      found = null;
    this.run.tracks.forEach((track, i) => {
      const state = eye.on ? this.space.states[i] : this.states[i];
      const at =
        state &&
        (eye.on ? this.space.project(state.x, state.y, state.z + 0.8) : this.toScreen(state.x, state.y, width, height));
      if (!at) return;
      const scale = eye.on ? height / at[2] : camera.scale;
      const away = Math.hypot(at[0] - event.clientX + left, at[1] - event.clientY + top) - (track.box[2] / 2) * scale;
      if (away < best) [best, found] = [away, track.name];
    });
    if (found !== null) {
      follow(found === this.run.ego ? "" : found);
      this.changed();
    }
  }

  wheel(event) {
    event.preventDefault();
    const factor = Math.exp(-event.deltaY * (event.deltaMode ? 0.05 : 0.0015));
    if (eye.on) {
      nearer(factor);
      return this.changed();
    }
    const { left, top, width, height } = this.canvas.getBoundingClientRect();
    const x = event.clientX - left - width / 2,
      y = height / 2 - event.clientY + top,
      before = camera.scale;
    zoom(factor);
    const shift = 1 / before - 1 / camera.scale; // what is under the pointer stays there
    this.pan(x * shift * camera.scale, y * shift * camera.scale);
    return this.changed();
  }
}
