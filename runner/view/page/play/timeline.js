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

const SHOWN = 6; // participants whose rows are seen at once; the others are unfolded
const WHOLE = "the run"; // whom rows are about that are about nobody

/** Rows by participant, the ego first, then its partners, then the others; with a name each. */
function byParticipant(run) {
  const groups = new Map([[WHOLE, []], [run.ego, []], ...run.partners.map(([, name]) => [name, []])]);
  for (const row of run.rows)
    for (const name of row[4].length ? row[4] : [WHOLE]) {
      if (!groups.has(name)) groups.set(name, []);
      groups.get(name).push(row);
    }
  return [...groups].filter(([, rows]) => rows.length);
}

/** What happens over time: one row a participant, which unfolds into a row for each act, event and action. */
class Timeline {
  constructor(run, index, end, seek) {
    Object.assign(this, { run, end, seek });
    this.cursor = el("div", { class: "cursor" });
    this.lane = el(
      "div",
      { class: "axis" },
      ...ticks(0, end, 5).map(time => el("i", { style: `left:${(100 * time) / end}%` }, `${Number(time.toPrecision(4))} s`)),
    );
    const groups = byParticipant(run).map(([name, rows], i) => this.group(name, rows, `rows${index}-${i}`)),
      [first, others] = [groups.slice(0, SHOWN), groups.slice(SHOWN)];
    this.rows = el(
      "div",
      { class: "rows" },
      ...first,
      others.length ? unfolding(`${others.length} others`, `others${index}`, others) : null,
      el("div", { class: "row" }, el("span"), this.lane),
      this.cursor,
    );
    this.node = el(
      "div",
      { class: `run${index}` },
      groups.length ? this.rows : el("p", { class: "muted" }, "Nothing happened in this run's storyboard."),
    );
  }

  group(name, rows, id) {
    const summary = rows.filter(([level]) => level !== "event" || !rows.some(([other]) => other === "action"));
    const inner = rows.map(([level, label, subject, bars]) =>
      el(
        "div",
        { class: "row" },
        el("span", { class: "inner", title: subject }, label, " ", el("small", null, level)),
        el("div", { class: "lane" }, ...bars.map(bar => this.bar(level, label, bar))),
      ),
    );
    const all = summary.flatMap(([level, label, , bars]) => bars.map(bar => this.bar(level, label, bar)));
    return unfolding(name, id, inner, el("div", { class: "lane" }, ...all));
  }

  bar(level, label, [from, until, why]) {
    const to = until ?? this.run.end,
      text = `${label}, ${seconds(from)}${to > from ? ` to ${seconds(to)}` : ""}${why ? `: ${why}` : ""}`;
    const style = `left:${(100 * from) / this.end}%` + (level === "note" ? "" : `;width:${(100 * (to - from)) / this.end}%`);
    return el("button", { class: `bar ${level}`, style, title: text, "aria-label": text, click: () => this.seek(from) });
  }

  show(time) {
    const { left, width } = this.lane.getBoundingClientRect();
    const offset = left - this.rows.getBoundingClientRect().left;
    this.cursor.style.transform = `translateX(${offset + Math.min(1, time / this.end) * width - 1}px)`;
  }
}

/** A row with a name that shows and hides others. */
function unfolding(name, id, inner, lane) {
  const box = el("div", { id, hidden: true }, ...inner);
  const button = el(
    "button",
    {
      class: "unfold",
      title: name,
      "aria-expanded": "false",
      "aria-controls": id,
      click: () => {
        box.hidden = !box.hidden;
        button.setAttribute("aria-expanded", String(!box.hidden));
      },
    },
    name,
  );
  return el("div", null, el("div", { class: "row" }, button, lane ?? el("span")), box);
}

/** A line of a run's event log in words, with the actors of storyboard elements. */
function sentenceOf(run, [, kind, subject, text]) {
  if (kind.startsWith("collision")) return `${subject} ${text}`;
  const what = kind in KINDS ? KINDS[kind] : kind,
    path = subject.split("::"),
    element = kind.endsWith("Transition"),
    actors = (element && run.actors[path.slice(0, 3).join("::")]) || [];
  const whom = (actors.length ? `${actors.join(", ")}: ` : "") + (element ? path.pop() : subject);
  return `${whom} ${what}${text ? `: ${text}` : ""}`;
}

class Log {
  constructor(run, index, seek) {
    this.times = run.events.map(([time]) => time);
    this.items = run.events.map(entry => {
      const [time, , subject] = entry;
      return el(
        "button",
        { title: subject, tabindex: -1, click: () => seek(time) },
        el("time", null, seconds(time)),
        el("span", { class: "what" }, sentenceOf(run, entry)),
      );
    });
    this.box = el(
      "div",
      { class: `scroll run${index}` },
      el("ol", { class: "log" }, ...this.items.map(item => el("li", null, item))),
    );
    this.node = this.items.length ? this.box : el("p", { class: "muted" }, "The event log is empty.");
    this.current = undefined;
    this.box.addEventListener("keydown", event => this.step(event));
    this.box.addEventListener("focusin", event => this.stop(this.items.indexOf(event.target)));
    this.stop(0);
  }

  /** Let the Tab key find one line only; the arrow keys lead to the others. */
  stop(index) {
    if (this.items[this.stopped]) this.items[this.stopped].tabIndex = -1;
    this.stopped = index;
    if (this.items[index]) this.items[index].tabIndex = 0;
  }

  step(event) {
    const last = this.items.length - 1,
      goal = { ArrowUp: this.stopped - 1, ArrowDown: this.stopped + 1, Home: 0, End: last }[event.key];
    if (goal === undefined) return;
    event.preventDefault();
    event.stopPropagation();
    this.items[Math.min(last, Math.max(0, goal))].focus();
  }

  show(time) {
    const current = this.times.findLastIndex(each => each <= time + 1e-6);
    if (current === this.current) return;
    this.current = current;
    this.items.forEach((item, i) => {
      item.className = i === current ? "current" : i < current ? "past" : "future";
    });
    const item = this.items[current];
    if (item && !this.box.contains(document.activeElement)) this.stop(current);
    if (item) this.box.scrollTop = item.offsetTop - this.box.clientHeight / 2;
  }
}

class Participants {
  constructor(run, index, changed) {
    this.run = run;
    const first = [run.ego, ...run.partners.map(([, name]) => name)],
      rank = ({ name }) => (first.includes(name) ? first.indexOf(name) : first.length);
    this.tracks = [...run.tracks].sort((a, b) => rank(a) - rank(b));
    const entries = this.tracks.map(track => {
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
      const state = stateAt(this.tracks[i], Math.min(time, this.run.end), this.run.sample);
      speed.textContent = state ? `${state.v.toFixed(1)} m/s` : "absent";
      row.className = state ? "" : "gone";
      button.setAttribute("aria-pressed", String(camera.follow === name));
    });
  }
}
