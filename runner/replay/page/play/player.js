// The page: clock, controls, keyboard.

const data = JSON.parse(document.getElementById("data").textContent);
const roads = data.roads.map(road => unpackRoad(road, data.steps));
const runs = data.runs.map(run => unpackRun(run, data));
for (const run of runs) {
  run.collisions = run.rows
    .filter(([level]) => level === "collision")
    .flatMap(([, , subject, bars]) => bars.map(([from, to]) => ({ from, to: to ?? run.end, who: subject.split(" – ") })));
}
const end = Math.max(...runs.map(run => run.end), 0.01);
const RATES = [0.1, 0.25, 0.5, 1, 2, 5, 10];
const TABLES = 0.1; // s between updates of tables while playing

const clock = { time: 0, playing: false, rate: 1, last: 0, dirty: true, shown: 0 };
const changed = () => {
  clock.dirty = true;
};

function seek(time) {
  clock.time = Math.min(end, Math.max(0, time));
  changed();
}

function play(on) {
  if (on && clock.time >= end - 1e-6) seek(0);
  clock.playing = on;
  clock.last = performance.now();
  changed();
}

// elements ------------------------------------------------------------------------------------

const views = runs.map((run, i) => new View(run, run.road === null ? null : roads[run.road], i, changed));
const timelines = runs.map((run, i) => new Timeline(run, i, end, seek));
const logs = runs.map((run, i) => new Log(run, i, seek));
const tables = runs.map((run, i) => new Participants(run, i, changed));
const plots = charts(runs, end, seek);
const sign = index =>
  runs.length > 1
    ? el("span", { class: `sign run${index}`, role: "img", "aria-label": `run ${"AB"[index]}` }, "AB"[index])
    : null;

const button = (label, action, attributes, text) =>
  el("button", { "aria-label": label, title: label, click: action, ...attributes }, text);
const playButton = button("Play", () => play(!clock.playing), { class: "play" }, "Play");
const clockText = el("output", { id: "clock", "aria-live": "off" });
const slider = el("input", {
  type: "range",
  min: 0,
  max: end,
  step: "any",
  "aria-label": "Time in seconds",
  input: () => seek(Number(slider.value)),
});
const rate = el(
  "select",
  {
    "aria-label": "Speed",
    change: () => {
      clock.rate = Number(rate.value);
    },
  },
  ...RATES.map(each => el("option", { value: each, selected: each === 1 }, `${each} ×`)),
);
const names = [...new Set(runs.flatMap(run => run.tracks.map(track => track.name)))].filter(name =>
  runs.some(run => run.ego !== name),
);
const hasEgo = runs.some(run => run.ego !== null && run.tracks.some(track => track.name === run.ego));
const whom = el(
  "select",
  {
    "aria-label": "Follow",
    change: () => {
      choose(whom.value);
    },
  },
  ...(hasEgo ? [el("option", { value: "ego" }, "the ego")] : []),
  el("option", { value: "none" }, "nobody"),
  ...names.map(name => el("option", { value: `=${name}` }, name)),
);
const labels = el("input", {
  type: "checkbox",
  checked: true,
  change: () => {
    for (const view of views) view.labels = labels.checked;
    changed();
  },
});
const announced = el("div", { class: "hidden", "aria-live": "polite" });

/** Follow the ego, nobody (and stay where the view is), or a name. */
function choose(value) {
  if (value === "none") Object.assign(camera, { follow: null, x: views[0].middle[0], y: views[0].middle[1] });
  else follow(value === "ego" ? "" : value.slice(1));
  changed();
}

/** What a run is given that the other one is given differently. */
function differing(index) {
  if (runs.length < 2) return [];
  const given = run => ({ ...run.parameters, "system under test": run.sut, ...run.settings });
  const [own, other] = [given(runs[index]), given(runs[1 - index])];
  const found = Object.keys(own)
    .filter(name => own[name] !== other[name])
    .map(name => `${name} ${own[name]}`);
  return found.length ? [el("small", null, ` ${found.join(", ")}`)] : [];
}

function figure(run, i) {
  const values = Object.entries({ ...run.parameters, "system under test": run.sut, ...run.settings });
  const caption = el(
    "figcaption",
    null,
    sign(i),
    el(runs.length > 1 ? "h2" : "h1", null, run.name, ...differing(i)),
    el("span", { class: `badge ${run.passed ? "passed" : "failed"}` }, run.passed ? "passed" : "failed"),
    el(
      "span",
      { class: "reason muted" },
      [`${seconds(run.end)}, ${ENDS[run.status]}`, ...run.reasons].join("; "),
    ),
    el(
      "details",
      null,
      el("summary", { class: "muted" }, "parameters and settings"),
      el("dl", null, ...values.flatMap(([name, value]) => [el("dt", null, name), el("dd", null, value)])),
    ),
  );
  const zooms = el(
    "div",
    { class: "zoom" },
    button(
      "Zoom in",
      () => {
        zoom(1.4);
        changed();
      },
      null,
      "+",
    ),
    button(
      "Zoom out",
      () => {
        zoom(1 / 1.4);
        changed();
      },
      null,
      "−",
    ),
    button(
      "Show everything",
      () => {
        views[i].fit();
        changed();
      },
      null,
      "⤢",
    ),
  );
  return el("figure", { class: `run${i}` }, caption, el("div", { class: "stage" }, views[i].canvas, views[i].told, zooms));
}

const HELP = [
  ["Space", "play, pause"],
  ["← →", "one step; with Shift one second"],
  ["Home End", "beginning, end"],
  ["+ −", "zoom"],
  ["F", "follow the ego"],
  ["0", "show everything"],
  ["L", "labels"],
  [", .", "slower, faster"],
];
const help = el(
  "details",
  { class: "panel" },
  el("summary", null, "Keys"),
  el(
    "dl",
    null,
    ...HELP.flatMap(([keys, what]) => [
      el("dt", null, ...keys.split(" ").flatMap(key => [el("kbd", null, key), " "])),
      el("dd", null, what),
    ]),
  ),
);

const each = (title, parts) =>
  el(
    "section",
    { class: "panel", "aria-label": title },
    el("h2", null, title),
    ...parts.flatMap((part, i) => [runs.length > 1 ? el("p", { class: "muted" }, sign(i), " ", runs[i].name) : null, part.node]),
  );
const chartPanel = plots.length
  ? el(
      "section",
      { class: "panel", "aria-label": "Ego and criticality" },
      el("h2", null, "Ego and criticality"),
      el("div", { class: "charts" }, ...plots.map(plot => plot.node)),
    )
  : el(
      "section",
      { class: "panel" },
      el("h2", null, "Ego and criticality"),
      el("p", { class: "muted" }, "There is no ego in this run."),
    );

document.body.append(
  el(
    "main",
    { id: "page" },
    ...[
      runs.length > 1 ? el("h1", null, "Two runs") : null,
      el("div", { class: "views" }, ...runs.map(figure)),
      el(
        "div",
        { class: "panel controls", role: "group", "aria-label": "Playback" },
        slider,
        playButton,
        button("One step back", () => step(-1), null, "◀"),
        button("One step ahead", () => step(1), null, "▶"),
        clockText,
        el("span", { class: "spacer" }),
        el("label", null, el("span", { class: "optional" }, "Speed"), rate),
        el("label", null, el("span", { class: "optional" }, "Follow"), whom),
        el("label", null, labels, "Labels"),
      ),
      el(
        "div",
        { class: "lower" },
        el(
          "div",
          { class: "column" },
          each("Triggers and actions", timelines),
          each("Event log", logs),
          each("Participants", tables),
        ),
        el("div", { class: "column" }, chartPanel, help),
      ),
      announced,
    ].filter(Boolean),
  ),
);

function step(count) {
  play(false);
  seek(clock.time + count * runs[0].sample);
  announce();
}

/** Say where things are, for those who do not see the picture. */
function announce() {
  const parts = runs.map((run, i) => {
    const state = run.tracks
      .map(track => [track.name, stateAt(track, Math.min(clock.time, run.end), run.sample)])
      .filter(([, each]) => each);
    return (
      (runs.length > 1 ? `run ${"AB"[i]}: ` : "") +
      state
        .slice(0, 5)
        .map(([name, { v }]) => `${name} ${v.toFixed(1)} metres per second`)
        .join(", ")
    );
  });
  announced.textContent = `${seconds(clock.time)}. ${parts.join(". ")}`;
}

// keyboard ------------------------------------------------------------------------------------

const KEYS = {
  " ": () => play(!clock.playing),
  ArrowLeft: event => (event.shiftKey ? seek(clock.time - 1) : step(-1)),
  ArrowRight: event => (event.shiftKey ? seek(clock.time + 1) : step(1)),
  Home: () => seek(0),
  End: () => seek(end),
  "+": () => zoom(1.25),
  "=": () => zoom(1.25),
  "-": () => zoom(0.8),
  0: () => views[0].fit(),
  f: () => choose(hasEgo ? "ego" : "none"),
  l: () => labels.click(),
  ",": () => faster(-1),
  ".": () => faster(1),
};

function faster(by) {
  rate.selectedIndex = Math.min(RATES.length - 1, Math.max(0, rate.selectedIndex + by));
  clock.rate = Number(rate.value);
}

addEventListener("keydown", event => {
  const at = event.target,
    key = event.key.length === 1 ? event.key.toLowerCase() : event.key;
  const typed =
    at.tagName === "SELECT" ||
    (key === " " && ["BUTTON", "SUMMARY"].includes(at.tagName)) ||
    (key === " " && at.type === "checkbox");
  if (event.ctrlKey || event.metaKey || event.altKey || typed || !(key in KEYS)) return;
  event.preventDefault();
  KEYS[key](event);
  changed();
});

// the clock -----------------------------------------------------------------------------------

function frame(now) {
  if (clock.playing) {
    clock.time = Math.min(end, clock.time + ((now - clock.last) / 1000) * clock.rate);
    clock.last = now;
    clock.dirty = true;
    if (clock.time >= end) play(false);
  }
  if (clock.dirty) show();
  requestAnimationFrame(frame);
}

function show() {
  clock.dirty = false;
  const { time } = clock;
  for (const part of [...views.map(view => ({ show: t => view.draw(t) })), ...timelines, ...plots]) part.show(time);
  slider.value = time;
  slider.setAttribute("aria-valuetext", seconds(time));
  clockText.textContent = `${time.toFixed(2)} / ${seconds(end)}`;
  playButton.textContent = clock.playing ? "Pause" : "Play";
  playButton.setAttribute("aria-label", playButton.textContent);
  if (!clock.playing || Math.abs(time - clock.shown) >= TABLES * clock.rate) {
    clock.shown = time;
    for (const part of [...logs, ...tables]) part.show(time);
    whom.value = camera.follow === null ? "none" : camera.follow === "" ? "ego" : `=${camera.follow}`;
  }
}

function redraw() {
  const colour = palette();
  for (const view of views) view.colour = colour;
  for (const plot of plots) plot.draw(colour);
  changed();
}

/** Begin at the time that the address names (#t=5.05), close to the ego, or with everything in sight. */
function begin() {
  const given = new URLSearchParams(location.hash.slice(1)).get("t");
  if (given !== null && Number.isFinite(Number(given))) seek(Number(given));
  views[0].fit();
  if (hasEgo) {
    camera.scale = Math.max(camera.scale, Math.min(Math.max(views[0].canvas.clientWidth / 120, 6), 12));
    follow("");
  }
  redraw();
}

new ResizeObserver(redraw).observe(document.getElementById("page"));
matchMedia("(prefers-color-scheme: dark)").addEventListener("change", redraw);
addEventListener("hashchange", begin);
begin();
requestAnimationFrame(frame);
