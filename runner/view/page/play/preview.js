// Small moving pictures of the worst moments of runs.

const REST = 1; // s for which the last instant stays
const moving = matchMedia("(prefers-reduced-motion: no-preference)");

/** A canvas that plays a preview again and again while it is in sight and `on`; else it shows the worst moment. */
class Preview {
  constructor(data, label) {
    this.data = data;
    this.tracks = data.tracks.map(track => unpackTrack(track, data.steps));
    this.road = data.road && unpackRoad(data.road, data.steps);
    this.canvas = el("canvas", { role: "img", "aria-label": label });
    this.seen = false;
    new IntersectionObserver(([entry]) => {
      this.seen = entry.isIntersecting;
      if (this.seen) this.draw(this.last);
    }).observe(this.canvas);
  }

  /** The time to show at an instant of the clock, s. */
  at(clock) {
    const { from, to } = this.data;
    return Math.min(to, from + (clock % (to - from + REST)));
  }

  get last() {
    return this.data.to;
  }

  draw(time) {
    const { ctx, width, height, ratio } = fitted(this.canvas),
      colour = palette(),
      { ego, pair, sample } = this.data;
    const states = this.tracks.map(track => stateAt(track, time, sample)),
      there = this.tracks.map((track, i) => i).filter(i => states[i] && pair.includes(this.tracks[i].name));
    ctx.setTransform(1, 0, 0, 1, 0, 0);
    ctx.fillStyle = colour("ground");
    ctx.fillRect(0, 0, this.canvas.width, this.canvas.height);
    if (!there.length) return;
    const of = values => there.map(i => values[i]),
      { middle, scale } = framing(of(this.tracks), of(states), width, height);
    const [x, y] = middle;
    ctx.setTransform(scale * ratio, 0, 0, -scale * ratio, (width / 2 - x * scale) * ratio, (height / 2 + y * scale) * ratio);
    if (this.road) drawRoad(ctx, this.road, colour, scale);
    this.tracks.forEach((track, i) => {
      if (states[i]) drawParticipant(ctx, track, states[i], colour, look(track, ego), scale, null);
    });
    ctx.setTransform(ratio, 0, 0, ratio, 0, 0);
    for (const i of there) {
      const text = `${this.tracks[i].name} ${states[i].v.toFixed(0)} m/s`;
      drawLabel(ctx, text, width / 2 + (states[i].x - x) * scale, height / 2 - (states[i].y - y) * scale - 14, colour, true);
    }
  }
}

/** Play previews together; gives a button that pauses them. */
function playing(previews) {
  let on = moving.matches,
    begin = performance.now();
  const button = el(
    "button",
    {
      click: () => {
        on = !on;
        begin = performance.now();
        told();
      },
    },
    "",
  );
  const told = () => {
    button.textContent = on ? "Pause" : "Play";
    if (!on) for (const each of previews) each.draw(each.last);
  };
  const frame = now => {
    if (on) for (const each of previews) if (each.seen) each.draw(each.at((now - begin) / 1000));
    requestAnimationFrame(frame);
  };
  told();
  requestAnimationFrame(frame);
  return button;
}
