// Films of scenarios: lanes, the ego, its partner and others about an event, on one small canvas each.

const data = JSON.parse(document.getElementById("data").textContent);
const RATE = 3; // times as fast as recorded
const DM = 10,
  HEADING = 100;
const LEAST = 35,
  MOST = 60; // distance ahead (m) that films show

/** Running sums of differences, two or three columns beside each other. */
function summed(steps, width) {
  const found = new Float64Array(steps.length);
  for (let i = 0; i < found.length; i++) found[i] = steps[i] + (i < width ? 0 : found[i - width]);
  return found;
}

/** Borders of lanes of a road as paths with their bounds, made when they are needed first. */
const roads = [];
function bordersOf(road) {
  if (!roads[road])
    roads[road] = data.roads[road].map(steps => {
      const points = summed(steps, 2),
        path = new Path2D(),
        box = [Infinity, Infinity, -Infinity, -Infinity];
      for (let i = 0; i < points.length; i += 2) {
        const x = points[i] / DM,
          y = points[i + 1] / DM;
        path[i ? "lineTo" : "moveTo"](x, y);
        box[0] = Math.min(box[0], x);
        box[1] = Math.min(box[1], y);
        box[2] = Math.max(box[2], x);
        box[3] = Math.max(box[3], y);
      }
      return { path, box };
    });
  return roads[road];
}

/** A film as it is drawn: participants with their samples, duration, the event's time, and the reach and turn of the view. */
function filmOf(row) {
  const packed = data.films[row];
  if (!packed) return null;
  const [x, y, start, partner, ...parts] = packed;
  const actors = parts.map(([length, width, first, ...steps], i) => ({
    length: length / DM,
    width: width / DM,
    first,
    places: summed(steps, 3),
    role: i === 0 ? "ego" : i === 1 && partner ? "partner" : "other",
  }));
  const samples = Math.max(...actors.map(each => each.first + each.places.length / 3)),
    duration = (samples - 1) * data.step,
    event = Math.min(Math.max(-start, 0), duration),
    at = actors.slice(0, 1 + partner).map(each => placeAt(each, event)).filter(Boolean);
  const apart = at.length > 1 ? Math.hypot(at[1][0] - at[0][0], at[1][1] - at[0][1]) : 0,
    reach = Math.min(Math.max(LEAST, apart + 8), MOST);
  return { x, y, start, event, actors, reach, turn: at[0][2], duration, road: data.coded.road[row] };
}

/** Place of a participant at a time: x, y, heading; null where it is absent. */
function placeAt({ first, places }, time) {
  const at = time / data.step - first,
    last = places.length / 3 - 1;
  if (at < -0.001 || at > last + 0.001) return null;
  const row = Math.min(Math.max(Math.floor(at), 0), Math.max(last - 1, 0)),
    share = Math.min(Math.max(at - row, 0), 1);
  const next = Math.min(row + 1, last),
    value = axis => places[3 * row + axis] + share * (places[3 * next + axis] - places[3 * row + axis]);
  return [value(0) / DM, value(1) / DM, value(2) / HEADING];
}

const ROLES = { ego: "accent", partner: "bad", other: "muted" };

/** Draw a film at a time (s from its beginning): the ego stays in the middle, its heading at the event points to the right. */
function drawFilm(canvas, film, time) {
  const { ctx, width, height, ratio } = fitted(canvas),
    scale = width / (2 * film.reach),
    [x, y] = placeAt(film.actors[0], time) ?? placeAt(film.actors[0], film.event),
    far = Math.hypot(width, height) / 2 / scale;
  ctx.clearRect(0, 0, width, height);
  ctx.save();
  ctx.setTransform(ratio * scale, 0, 0, -ratio * scale, (ratio * width) / 2, (ratio * height) / 2);
  ctx.rotate(-film.turn);
  ctx.translate(-x - film.x, -y - film.y);
  ctx.strokeStyle = colour("line");
  ctx.lineWidth = 1.4 / scale;
  for (const { path, box } of bordersOf(film.road))
    if (box[0] < film.x + x + far && box[2] > film.x + x - far && box[1] < film.y + y + far && box[3] > film.y + y - far)
      ctx.stroke(path);
  ctx.translate(film.x, film.y);
  for (const actor of [...film.actors].reverse()) {
    ctx.strokeStyle = ctx.fillStyle = colour(ROLES[actor.role]);
    if (actor.role !== "other") {
      ctx.globalAlpha = 0.5;
      ctx.lineWidth = 1.5 / scale;
      ctx.beginPath();
      for (let i = 0; i < actor.places.length; i += 3) ctx.lineTo(actor.places[i] / DM, actor.places[i + 1] / DM);
      ctx.stroke();
      ctx.globalAlpha = 1;
    }
    const place = placeAt(actor, time);
    if (!place) continue;
    const long = Math.max(actor.length, 5 / scale),
      wide = Math.max(actor.width, 3 / scale);
    ctx.save();
    ctx.translate(place[0], place[1]);
    ctx.rotate(place[2]);
    ctx.fillRect(-long / 2, -wide / 2, long, wide);
    ctx.restore();
  }
  ctx.restore();
  ctx.fillStyle = colour("muted");
  ctx.font = "11px system-ui, sans-serif";
  ctx.fillText(`${(film.start + time).toFixed(1)} s`, 6, height - 6);
}

/** Films that play now, by their canvas: film and the moment that they began. */
const playing = new Map();
function tick(now) {
  for (const [canvas, { film, began }] of playing) {
    if (!canvas.isConnected) playing.delete(canvas);
    else drawFilm(canvas, film, (((now - began) / 1000) * RATE) % (film.duration + 1));
  }
  if (playing.size) requestAnimationFrame(tick);
}

function play(canvas, film) {
  const idle = !playing.size;
  playing.set(canvas, { film, began: performance.now() });
  if (idle) requestAnimationFrame(tick);
}

/** Stop a film; it shows the event again. */
function stop(canvas, film) {
  playing.delete(canvas);
  drawFilm(canvas, film, film.event);
}
