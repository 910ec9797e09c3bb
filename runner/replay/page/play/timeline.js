// The storyboard over time, the event log and the participants of one run.

const KINDS = {
  startTransition: "starts",
  endTransition: "ends",
  stopTransition: "is stopped",
  skipTransition: "is skipped",
  interventionStart: "intervenes",
  interventionEnd: "ends its intervention",
  collision: "",
  collisionEnd: "",
};

class Timeline {
  constructor(run, index, end, seek) {
    this.end = end;
    this.cursor = el("div", { class: "cursor" });
    this.lane = el(
      "div",
      { class: "axis" },
      ...ticks(0, end, 5).map(time => el("i", { style: `left:${(100 * time) / end}%` }, `${Number(time.toPrecision(4))} s`)),
    );
    const rows = run.rows.map(([level, label, subject, bars]) =>
      el(
        "div",
        { class: "row" },
        el("span", { title: subject }, label, " ", el("small", null, level)),
        el("div", { class: "lane" }, ...bars.map(bar => this.bar(level, label, bar, run.end, seek))),
      ),
    );
    this.rows = el("div", { class: "rows" }, ...rows, el("div", { class: "row" }, el("span"), this.lane), this.cursor);
    this.node = el(
      "div",
      { class: `run${index}` },
      run.rows.length ? this.rows : el("p", { class: "muted" }, "Nothing happened in this run's storyboard."),
    );
  }

  bar(level, label, [from, until, why], last, seek) {
    const to = until ?? last,
      text = `${label}, ${seconds(from)}${to > from ? ` to ${seconds(to)}` : ""}${why ? `: ${why}` : ""}`;
    const style = `left:${(100 * from) / this.end}%` + (level === "note" ? "" : `;width:${(100 * (to - from)) / this.end}%`);
    return el("button", { class: `bar ${level}`, style, title: text, "aria-label": text, click: () => seek(from) });
  }

  show(time) {
    const { left, width } = this.lane.getBoundingClientRect();
    const offset = left - this.rows.getBoundingClientRect().left;
    this.cursor.style.transform = `translateX(${offset + Math.min(1, time / this.end) * width - 1}px)`;
  }
}

class Log {
  constructor(run, index, seek) {
    this.times = run.events.map(([time]) => time);
    this.items = run.events.map(([time, kind, subject, text]) => {
      const what = kind in KINDS ? KINDS[kind] : kind;
      const whom = kind.endsWith("Transition") ? subject.split("::").pop() : subject;
      const words = kind.startsWith("collision") ? `${subject} ${text}` : `${whom} ${what}${text ? `: ${text}` : ""}`;
      return el(
        "button",
        { title: subject, click: () => seek(time) },
        el("time", null, seconds(time)),
        el("span", { class: "what" }, words),
      );
    });
    this.box = el(
      "div",
      { class: `scroll run${index}` },
      el("ol", { class: "log" }, ...this.items.map(item => el("li", null, item))),
    );
    this.node = this.items.length ? this.box : el("p", { class: "muted" }, "The event log is empty.");
    this.current = undefined;
  }

  show(time) {
    const current = this.times.findLastIndex(each => each <= time + 1e-6);
    if (current === this.current) return;
    this.current = current;
    this.items.forEach((item, i) => {
      item.className = i === current ? "current" : i < current ? "past" : "future";
    });
    const item = this.items[current];
    if (item) this.box.scrollTop = item.offsetTop - this.box.clientHeight / 2;
  }
}

class Participants {
  constructor(run, index, changed) {
    this.run = run;
    const entries = run.tracks.map(track => {
      const name = track.name === run.ego ? "" : track.name;
      const button = el(
        "button",
        {
          click: () => {
            follow(camera.follow === name ? null : name);
            changed();
          },
        },
        track.name,
      );
      const speed = el("td", { class: "number" }),
        swatch = el("span", { class: "swatch", style: `background:var(--${look(track, run.ego)})` });
      const kind = track.name === run.ego ? `${track.category}, ego` : track.category || track.kind;
      return { name, button, speed, row: el("tr", null, el("td", null, swatch, button), el("td", null, kind), speed) };
    });
    this.entries = entries;
    const head = el(
      "tr",
      null,
      el("th", null, "name (click to follow)"),
      el("th", null, "type"),
      el("th", { class: "number" }, "speed"),
    );
    this.node = el(
      "div",
      { class: `scroll who run${index}` },
      el("table", null, el("thead", null, head), el("tbody", null, ...entries.map(each => each.row))),
    );
  }

  show(time) {
    this.entries.forEach(({ name, button, speed, row }, i) => {
      const state = stateAt(this.run.tracks[i], Math.min(time, this.run.end), this.run.sample);
      speed.textContent = state ? `${state.v.toFixed(1)} m/s` : "absent";
      row.className = state ? "" : "gone";
      button.setAttribute("aria-pressed", String(camera.follow === name));
    });
  }
}
