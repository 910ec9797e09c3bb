// Roads and participants on a canvas whose transform maps world metres to pixels.

const SURFACES = ["verge", "walk", "shoulder", "bike", "road"];
const DASHES = { broken: [3, 6], dots: [0.15, 1.5] };
const MARK_COLOURS = {
  yellow: "#f0be00",
  blue: "#4a90ff",
  green: "#2fa84f",
  red: "#e0483d",
  orange: "#f08a24",
  violet: "#a86be0",
};
const HEAVY = new Set(["truck", "bus", "semitrailer", "trailer", "train", "tram"]);
const CYCLES = new Set(["bicycle", "motorbike"]);

/** Colours of the page's style sheet, by name without the dashes. */
function palette() {
  const style = getComputedStyle(document.documentElement),
    found = new Map();
  return name => {
    if (!found.has(name)) found.set(name, style.getPropertyValue("--" + name).trim());
    return found.get(name);
  };
}

/** Name of the colour of a participant. */
function look(track, ego) {
  if (track.name === ego) return "ego";
  if (track.kind === "pedestrian") return "walker";
  if (track.kind !== "vehicle") return "thing";
  return HEAVY.has(track.category) ? "truck" : CYCLES.has(track.category) ? "cycle" : "car";
}

function drawRoad(ctx, road, colour, scale) {
  const order = [...road.surfaces].sort((a, b) => SURFACES.indexOf(a.look) - SURFACES.indexOf(b.look));
  for (const { look, path } of order) {
    ctx.fillStyle = ctx.strokeStyle = colour(look);
    ctx.lineWidth = 1 / scale; // closes hairlines between neighbours
    ctx.fill(path);
    ctx.stroke(path);
  }
  for (const { pattern, colour: name, width, path } of road.marks) {
    if (pattern === "unmarked" && scale < 1.5) continue;
    ctx.strokeStyle = pattern === "unmarked" ? colour("unmarked") : MARK_COLOURS[name] || colour("mark");
    ctx.lineWidth = Math.max(width, (pattern === "unmarked" ? 0.7 : 1) / scale);
    ctx.setLineDash(DASHES[pattern] || []);
    ctx.globalAlpha = Math.min(1, 0.25 + scale / 4);
    ctx.stroke(path);
  }
  ctx.setLineDash([]);
  for (const { look, path } of road.objects) {
    ctx.globalAlpha = 0.45;
    ctx.fillStyle = ctx.strokeStyle = colour(look === "crosswalk" ? "mark" : "thing");
    ctx.lineWidth = 1 / scale;
    ctx.fill(path);
    ctx.stroke(path);
  }
  ctx.globalAlpha = 1;
}

/** Signals of a road: lights in the colour that they show, all else as small squares. */
function drawSignals(ctx, road, states, time, colour, scale) {
  const r = Math.max(0.6, 4 / scale);
  for (const { id, x, y, dynamic } of road.signals) {
    if (!dynamic && scale < 3) continue;
    const shown = (states[id] || []).findLast(([since]) => since <= time + 1e-6);
    ctx.fillStyle = dynamic ? lamp(shown ? shown[1] : "") : colour("thing");
    ctx.strokeStyle = colour("outline");
    ctx.lineWidth = 1 / scale;
    ctx.beginPath();
    if (dynamic) ctx.arc(x, y, r, 0, 7);
    else ctx.rect(x - r / 2, y - r / 2, r, r);
    ctx.fill();
    ctx.stroke();
  }
}

/** The lit lamps of a light's state: those that are named in it, or of "on;off;off" (red, yellow, green) those that are on. */
function lampsOn(state) {
  const lamps = state.toLowerCase().split(";"),
    names = ["red", "yellow", "green"];
  return lamps.length === 3
    ? names.filter((_, i) => lamps[i].startsWith("on"))
    : names.filter(name => lamps[0].includes(name));
}

/** Colour of a light's state. */
function lamp(state) {
  const lit = lampsOn(state);
  const found = lit.length > 1 ? "yellow" : lit[0];
  return { red: "#e5322d", yellow: "#f5b800", green: "#1fae54" }[found] || "#9aa3ad";
}

/** A participant in its own frame: x ahead, y to the left, the reference point at the origin. */
function drawParticipant(ctx, track, state, colour, name, scale, marked) {
  const [bx, by, length, width] = track.box;
  ctx.save();
  ctx.translate(state.x, state.y);
  ctx.rotate(state.h);
  ctx.translate(bx, by);
  const fill = colour(name);
  if (Math.max(length, width) * scale < 7) drawFar(ctx, fill, scale, track.kind === "vehicle");
  else {
    if (marked) {
      ctx.lineWidth = 7 / scale;
      ctx.strokeStyle = marked;
      ctx.strokeRect(-length / 2, -width / 2, length, width);
    }
    ctx.fillStyle = fill;
    ctx.strokeStyle = colour("outline");
    ctx.lineWidth = 1 / scale;
    if (track.kind === "pedestrian") drawPedestrian(ctx, length, width);
    else if (name === "cycle") drawCycle(ctx, length, width, scale);
    else if (track.kind === "vehicle") drawVehicle(ctx, track, state, length, width, colour);
    else drawBox(ctx, length, width, 0);
  }
  ctx.restore();
}

/** A dot or an arrowhead of fixed size on the screen. */
function drawFar(ctx, fill, scale, arrow) {
  const r = 4.5 / scale;
  ctx.fillStyle = fill;
  ctx.beginPath();
  if (arrow) {
    ctx.moveTo(r * 1.5, 0);
    ctx.lineTo(-r, r);
    ctx.lineTo(-r, -r);
    ctx.closePath();
  } else ctx.arc(0, 0, r * 0.8, 0, 7);
  ctx.fill();
}

function drawBox(ctx, length, width, radius) {
  ctx.beginPath();
  ctx.roundRect(-length / 2, -width / 2, length, width, radius);
  ctx.fill();
  ctx.stroke();
}

function drawVehicle(ctx, track, state, length, width, colour) {
  const half = width / 2,
    front = length / 2,
    heavy = HEAVY.has(track.category);
  drawBox(ctx, length, width, Math.min(heavy ? 0.15 : 0.5, half));
  ctx.fillStyle = colour("glass");
  const deep = Math.min(length * 0.16, 0.8),
    at = track.category === "trailer" ? null : heavy ? front - deep : front - length * 0.28;
  if (at !== null) {
    // windscreen: narrower towards the front
    ctx.beginPath();
    ctx.moveTo(at, half * 0.82);
    ctx.lineTo(at, -half * 0.82);
    ctx.lineTo(at - deep, -half * 0.66);
    ctx.lineTo(at - deep, half * 0.66);
    ctx.fill();
  }
  if (!heavy) ctx.fillRect(-front + length * 0.1, -half * 0.62, deep * 0.7, width * 0.62);
  if (state.brakes) {
    ctx.fillStyle = "#ff2a1a";
    for (const side of [-1, 1])
      ctx.fillRect(-front - 0.1, side * half * 0.7 - width * 0.12, Math.max(0.25, length * 0.05), width * 0.24);
  }
}

function drawCycle(ctx, length, width, scale) {
  ctx.beginPath();
  ctx.ellipse(0, 0, length / 2, Math.max(width * 0.16, 0.1), 0, 0, 7);
  ctx.fill();
  ctx.stroke();
  ctx.lineWidth = Math.max(0.08, 1.5 / scale);
  ctx.strokeStyle = ctx.fillStyle;
  ctx.beginPath(); // handlebar
  ctx.moveTo(length * 0.24, -width / 2);
  ctx.lineTo(length * 0.24, width / 2);
  ctx.stroke();
  ctx.beginPath(); // rider
  ctx.ellipse(-length * 0.05, 0, length * 0.14, width * 0.42, 0, 0, 7);
  ctx.fill();
}

function drawPedestrian(ctx, length, width) {
  ctx.beginPath(); // shoulders
  ctx.ellipse(0, 0, length * 0.36, width / 2, 0, 0, 7);
  ctx.fill();
  ctx.stroke();
  ctx.beginPath(); // head, a little ahead
  ctx.arc(length * 0.14, 0, Math.min(length, width) * 0.27, 0, 7);
  ctx.fill();
  ctx.stroke();
}

/** Text with a halo, in CSS pixels. */
function drawLabel(ctx, text, x, y, colour, bold) {
  ctx.font = `${bold ? "600 " : ""}12px system-ui, sans-serif`;
  ctx.textAlign = "center";
  ctx.lineWidth = 4;
  ctx.lineJoin = "round";
  ctx.strokeStyle = colour("halo");
  ctx.strokeText(text, x, y);
  ctx.fillStyle = colour("text");
  ctx.fillText(text, x, y);
}

/** A bar that says how long a round number of metres is. */
function drawScale(ctx, scale, height, colour) {
  const power = 10 ** Math.floor(Math.log10(110 / scale));
  const metres = [5, 2, 1].map(n => n * power).find(n => n * scale <= 110) || power;
  ctx.strokeStyle = ctx.fillStyle = colour("text");
  ctx.lineWidth = 2;
  ctx.beginPath();
  ctx.moveTo(12, height - 18);
  ctx.lineTo(12, height - 12);
  ctx.lineTo(12 + metres * scale, height - 12);
  ctx.lineTo(12 + metres * scale, height - 18);
  ctx.stroke();
  drawLabel(ctx, `${metres} m`, 12 + (metres * scale) / 2, height - 20, colour);
}
