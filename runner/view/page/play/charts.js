// Curves over time, for one run or two.

/** Bounds of the axes: values beyond a cap run out of the picture. `worst` says which extreme matters. */
const AXES = {
  speed: { low: 0, worst: Math.max },
  acceleration: { zero: true, worst: Math.min },
  ttc: { low: 0, cap: 10, worst: Math.min },
  thw: { low: 0, cap: 6, worst: Math.min },
  rss_margin_ad_rss: { zero: true, worst: Math.min, forbidden: true },
  distance: { low: 0, cap: 60, worst: Math.min },
  drac: { low: 0, cap: 10, worst: Math.max },
};
const LEFT = 34,
  RIGHT = 6,
  TOP = 6,
  BOTTOM = 18;

class Chart {
  /** curves: the same measure of each run, undefined where a run has none. */
  constructor(curves, runs, end, seek) {
    const first = curves.find(Boolean);
    Object.assign(this, { curves, runs, end, axis: AXES[first.id], unit: first.unit, id: first.id, label: first.label });
    this.now = curves.map((_, index) => el("span", { class: `now run${index}` }));
    this.extremes = curves.map((curve, index) => curve && this.extreme(curve, runs[index].sample));
    this.canvas = el("canvas", { role: "img", "aria-label": `${first.label} over time. ${this.summary()}` });
    this.cursor = el("div", { class: "cursor" });
    const jumps = this.extremes.map(
      (extreme, i) =>
        extreme &&
        el("button", { class: `extreme run${i}`, click: () => seek(extreme.time) }, this.letter(i) + this.told(extreme)),
    );
    this.node = el(
      "div",
      { class: "chart" },
      el("h3", null, first.label, el("span", null, ...this.now)),
      el("div", { class: "plot" }, this.canvas, this.cursor),
      el("div", { class: "extremes" }, ...jumps.filter(Boolean)),
    );
    this.range = this.bounds();
    const go = event => {
      const { left, width } = this.canvas.getBoundingClientRect();
      seek(((event.clientX - left - LEFT) / (width - LEFT - RIGHT)) * this.end);
    };
    this.canvas.addEventListener("pointerdown", event => {
      this.canvas.setPointerCapture(event.pointerId);
      go(event);
    });
    this.canvas.addEventListener("pointermove", event => {
      if (event.buttons) go(event);
    });
  }

  extreme(curve, sample) {
    let best = null,
      beyond = null;
    for (const { start, values } of curve.parts)
      values.forEach((value, i) => {
        if (beyond === null && value > data.steps.braking) beyond = (start + i) * sample;
        if (best === null || (value !== best.value && this.axis.worst(value, best.value) === value))
          best = { value, time: (start + i) * sample };
      });
    return best && { ...best, beyond };
  }

  letter(index) {
    return this.runs.length > 1 ? `${"AB"[index]} ` : "";
  }

  /** A value with its unit; decelerations that no tyre gives are told as such. */
  measured(value) {
    return this.id === "drac" && value > data.steps.braking ? "unavoidable" : `${value.toFixed(2)} ${this.unit}`;
  }

  told(extreme) {
    if (this.id === "drac" && extreme.beyond !== null) return `unavoidable by braking from ${seconds(extreme.beyond)} on`;
    const which = this.axis.worst === Math.min ? "least" : "greatest";
    return `${which} ${this.measured(extreme.value)} at ${seconds(extreme.time)}`;
  }

  summary() {
    return this.extremes.map((extreme, i) => this.letter(i) + (extreme ? this.told(extreme) : "not defined")).join("; ");
  }

  bounds() {
    const all = this.curves.filter(Boolean).flatMap(curve => curve.parts.map(part => part.values));
    let low = this.axis.zero ? 0 : Infinity,
      high = this.axis.zero ? 0 : -Infinity;
    for (const values of all)
      for (const value of values) {
        low = Math.min(low, value);
        high = Math.max(high, value);
      }
    if (low > high) [low, high] = [0, 1];
    high = Math.min(high, this.axis.cap ?? Infinity);
    low = this.axis.low ?? low;
    if (high - low < 1) high = low + 1;
    const room = (high - low) * 0.05;
    return [this.axis.low ?? low - room, high + room];
  }

  draw(colour) {
    const { ctx, width, height } = fitted(this.canvas),
      [low, high] = this.range;
    const x = time => LEFT + (time / this.end) * (width - LEFT - RIGHT),
      y = value => TOP + ((high - value) / (high - low)) * (height - TOP - BOTTOM);
    ctx.clearRect(0, 0, width, height);
    if (this.axis.forbidden && low < 0) {
      ctx.fillStyle = colour("bad-soft");
      ctx.fillRect(LEFT, y(Math.min(0, high)), width - LEFT - RIGHT, y(low) - y(Math.min(0, high)));
    }
    ctx.font = "11px system-ui, sans-serif";
    ctx.textAlign = "right";
    ctx.textBaseline = "middle";
    ctx.lineWidth = 1;
    for (const value of ticks(low, high, 3)) {
      ctx.strokeStyle = colour("line");
      ctx.beginPath();
      ctx.moveTo(LEFT, y(value));
      ctx.lineTo(width - RIGHT, y(value));
      ctx.stroke();
      ctx.fillStyle = colour("muted");
      ctx.fillText(String(Number(value.toPrecision(3))), LEFT - 5, y(value));
    }
    this.drawTimes(ctx, x, width, height, colour);
    ctx.save();
    ctx.beginPath();
    ctx.rect(LEFT, 0, width - LEFT, height - BOTTOM + 1);
    ctx.clip();
    this.curves.forEach((curve, index) => curve && this.drawCurve(ctx, curve, index, colour, x, y));
    ctx.restore();
    this.place = x;
  }

  /** Round times below the curves. */
  drawTimes(ctx, x, width, height, colour) {
    const times = ticks(0, this.end, Math.max(2, Math.floor((width - LEFT - RIGHT) / 60)));
    for (const time of times) {
      const text = `${Number(time.toPrecision(4))}${time === times[times.length - 1] ? " s" : ""}`,
        half = ctx.measureText(text).width / 2;
      ctx.strokeStyle = colour("line");
      ctx.beginPath();
      ctx.moveTo(x(time), height - BOTTOM);
      ctx.lineTo(x(time), height - BOTTOM + 4);
      ctx.stroke();
      ctx.fillStyle = colour("muted");
      ctx.textAlign = "center";
      ctx.fillText(text, Math.min(x(time), width - half - 1), height - 6);
    }
  }

  drawCurve(ctx, curve, index, colour, x, y) {
    const two = this.curves.filter(Boolean).length > 1;
    ctx.strokeStyle = ctx.fillStyle = colour(index ? "other" : "accent");
    ctx.lineWidth = two && !index ? 5 : 2;
    ctx.globalAlpha = two && !index ? 0.55 : 1;
    const { sample } = this.runs[index];
    for (const { start, values } of curve.parts) {
      ctx.beginPath();
      values.forEach((value, i) => ctx.lineTo(x((start + i) * sample), y(value)));
      if (values.length === 1) ctx.lineTo(x(start * sample) + 2, y(values[0]));
      ctx.stroke();
    }
    ctx.globalAlpha = 1;
    const extreme = this.extremes[index];
    if (extreme) {
      ctx.beginPath();
      ctx.arc(x(extreme.time), y(extreme.value), 3.5, 0, 7);
      ctx.fill();
      if (two) this.mark(ctx, index, x(extreme.time), y(extreme.value), colour);
    }
  }

  /** The run's letter beside its extreme, A above and B below it. */
  mark(ctx, index, x, y, colour) {
    ctx.font = "700 11px system-ui, sans-serif";
    ctx.textAlign = "center";
    ctx.fillStyle = colour(index ? "other" : "accent");
    const { height } = ctx.canvas.getBoundingClientRect();
    const aside = index ? 9 : -9;
    ctx.fillText("AB"[index], Math.max(x + aside, LEFT + 6), Math.min(height - 6, Math.max(8, y + aside)));
  }

  show(time) {
    if (this.place) this.cursor.style.transform = `translateX(${this.place(time) - 1}px)`;
    this.curves.forEach((curve, i) => {
      const value = curve && time <= this.runs[i].end + 1e-6 ? valueAt(curve, time, this.runs[i].sample) : null;
      this.now[i].textContent = `${this.letter(i)}${value === null ? "–" : this.measured(value)} `;
    });
  }
}

/** A chart for each measure that any run has. */
function charts(runs, end, seek) {
  return Object.keys(AXES).flatMap(id => {
    const curves = runs.map(run => run.curves.find(curve => curve.id === id));
    return curves.some(curve => curve && curve.parts.length) ? [new Chart(curves, runs, end, seek)] : [];
  });
}
