// The page: clock, layout, keyboard. The runs that it shows may be replaced by others.

const data = JSON.parse(document.getElementById("data").textContent);
let roadData = [], // as they come
  roads = [],
  runs = [],
  end = 0.01;
const TABLES = 0.1; // s between updates of tables while playing
const ADDRESS = 1; // s between updates of the address

const clock = { time: 0, playing: false, rate: 1, last: 0, dirty: true, shown: 0, written: 0 };
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

let views = [],
  timelines = [],
  logs = [],
  tables = [],
  plots = [],
  found = [],
  hasEgo = false,
  hasPair = false;
let track = slider(end, found, seek);
let whom = el("select", { "aria-label": "Follow" });
const playButton = button("Play", () => play(!clock.playing), { class: "play" }, "Play");
const clockText = el("output", { id: "clock", "aria-live": "off" });
const rate = choice(
  "Speed",
  RATES.map(each => [each, `${each} ×`]),
  1,
  value => {
    clock.rate = Number(value);
  },
);

/** The choice of what is followed, for the runs that are shown. */
function followChoice() {
  const names = [...new Set(runs.flatMap(run => run.tracks.map(each => each.name)))].filter(name =>
    runs.some(run => run.ego !== name),
  );
  const followed = [
    ...(hasPair ? [["both", "ego and nearest"]] : []),
    ...(hasEgo ? [["ego", "the ego"]] : []),
    ["all", "everybody"],
    ["none", "nobody"],
    ...names.map(name => [`=${name}`, name]),
  ];
  return choice("Follow", followed, "", value => choose(value));
}

const labels = el("input", {
  type: "checkbox",
  checked: true,
  change: () => {
    for (const view of views) view.labels = labels.checked;
    changed();
  },
});
const announced = el("div", { class: "hidden", "aria-live": "polite" });

// three dimensions ----------------------------------------------------------------------------

const solidButton = button("Show in three dimensions", () => solid(!eye.on), { "aria-pressed": "false" }, "3-D");
const solidNote = el("span", { class: "note", role: "status" });
const cameraChoice = choice("Camera", CAMERAS, "chase", value => useCamera(value));
const shadows = el("input", {
  type: "checkbox",
  change: () => {
    eye.shadows = shadows.checked;
    changed();
  },
});
const solidChoices = el("span", { class: "choices", hidden: true }, cameraChoice, el("label", null, shadows, "Shadows"));
const fullButton = button("Fill the screen", fill, { hidden: !document.fullscreenEnabled }, "Full");

/** Show all views in three dimensions or from above; without WebGL they stay as they are, and the page says why. */
function solid(on) {
  if (on)
    for (const view of views) {
      view.space ??= Space.of(view, view.run.road === null ? null : roadData[view.run.road], data.steps);
      if (!view.space) {
        solidNote.textContent = "3-D needs WebGL 2, which this browser does not have or has switched off.";
        return;
      }
      view.canvas.after(view.space.canvas);
      view.space.canvas.addEventListener("webglcontextlost", lost);
    }
  eye.on = on;
  solidNote.textContent = "";
  solidButton.setAttribute("aria-pressed", String(on));
  solidChoices.hidden = !on;
  main.classList.toggle("solid", on);
  for (const view of views)
    view.canvas.setAttribute("aria-label", `${view.run.name} ${on ? "in three dimensions; drag to turn" : ABOVE}`);
  changed();
}

/** Drop what was drawn in three dimensions. */
function flatten() {
  for (const view of views) {
    if (view.space) view.space.canvas.remove();
    view.space = null;
  }
}

const lost = () => {
  solid(false);
  flatten();
  solidNote.textContent = "The graphics card has dropped the picture; press 3-D to draw it again.";
};

function useCamera(kind) {
  Object.assign(eye, { kind, turn: 0, tilt: 0, free: null });
  cameraChoice.value = kind;
  if (!eye.on) solid(true);
  changed();
}

function fill() {
  if (document.fullscreenElement) document.exitFullscreen();
  else
    watch.requestFullscreen().catch(() => (solidNote.textContent = "The browser does not let this page fill the screen."));
}

/** Follow ego and partner, the ego, everybody, nobody (and stay where the view is), or a name. */
function choose(value) {
  if (value === "none") Object.assign(camera, { follow: null, x: views[0].middle[0], y: views[0].middle[1] });
  else {
    if (value === "ego" && several()) camera.scale = usualScale();
    follow({ both: BOTH, all: ALL, ego: "" }[value] ?? value.slice(1));
  }
  changed();
}

const FOLLOWING = new Map([
  [null, "none"],
  [BOTH, "both"],
  [ALL, "all"],
  ["", "ego"],
]);
const chosen = () => FOLLOWING.get(camera.follow) ?? `=${camera.follow}`;
const usualScale = () => Math.min(Math.max(views[0].canvas.clientWidth / 120, 6), 12);

function stage(view, i) {
  const closer = factor => () => {
    scaleBy(factor);
    changed();
  };
  const everything = () => {
    if (eye.on) useCamera("chase");
    else view.fit();
    changed();
  };
  const zooms = el(
    "div",
    { class: "zoom" },
    button("Zoom in", closer(1.4), null, "+"),
    button("Zoom out", closer(1 / 1.4), null, "−"),
    button("Show all ways", everything, null, "⤢"),
    i ? null : button("Keys", () => toggleHelp(), { class: "optional" }, "?"),
  );
  const told = el("div", { class: "told" }, sign(runs, i), view.told);
  const looks = i ? null : el("div", { class: "looks" }, solidNote, solidChoices, solidButton, fullButton);
  return el("div", { class: `stage run${i}` }, view.canvas, told, looks, zooms);
}

const HELP = [
  ["Space", "play, pause"],
  ["← →", "one step; with Shift one second"],
  ["P N", "previous, next event"],
  ["Home End", "beginning, end"],
  ["+ −", "zoom; in 3-D nearer, farther"],
  ["B", "follow the ego and the nearest"],
  ["F", "follow the ego"],
  ["A", "follow everybody"],
  ["0", "show all ways"],
  ["L", "labels"],
  [", .", "slower, faster"],
  ["V", "3-D, or from above"],
  ["C", "next camera: chase, driver's, free"],
  ["W A S D", "free camera: ahead, left, back, right; with Shift turn it"],
  ["Q E", "free camera: down, up"],
  ["X", "fill the screen"],
  ["?", "these keys"],
];
const help = el(
  "dialog",
  { class: "panel keys", "aria-label": "Keys" },
  el("h2", null, "Keys"),
  el(
    "dl",
    null,
    ...HELP.flatMap(([keys, what]) => [
      el("dt", null, ...keys.split(" ").flatMap(key => [el("kbd", null, key), " "])),
      el("dd", null, what),
    ]),
  ),
  el("p", null, "Drag moves the picture, or in 3-D turns it; with Shift or the right button it moves the free camera. "),
  el("p", null, "A click on a participant follows it. In the event log, ↑ and ↓ go from line to line."),
  button("Close", () => help.close(), null, "Close"),
);
const toggleHelp = () => (help.open ? help.close() : help.showModal());

const section = (title, ...content) =>
  el("section", { class: "panel", "aria-label": title }, el("h2", null, title), ...content);
const each = (title, parts) =>
  section(
    title,
    ...parts.flatMap((part, i) => [
      runs.length > 1 ? el("p", { class: "muted" }, sign(runs, i), " ", runs[i].name) : null,
      part.node,
    ]),
  );
const chartPanel = () =>
  section(
    "Ego and criticality",
    plots.length
      ? el("div", { class: "charts" }, ...plots.map(plot => plot.node))
      : el("p", { class: "muted" }, "There is no ego in this run."),
  );
const controls = el(
  "div",
  { class: "panel controls", role: "group", "aria-label": "Playback" },
  track.node,
  playButton,
  button("One step back", () => step(-1), null, "◀"),
  button("One step ahead", () => step(1), null, "▶"),
  button("Previous event", () => jump(-1), null, "|◀"),
  button("Next event", () => jump(1), null, "▶|"),
  clockText,
  el("span", { class: "spacer" }),
  rate,
  whom,
  el("label", { class: "optional" }, labels, "Labels"),
);

const pair = el("h1", { hidden: true }, "Two runs");
const headlines = el("div", { class: "headlines" });
const watch = el("div", { class: "watch" }, controls);
const column = el("div", { class: "column" });
const desk = el("div", { class: "desk" }, watch, column);
const main = el(
  "main",
  { id: "page" },
  data.report ? el("nav", null, el("a", { href: data.report }, "← Report of all runs")) : null,
  pair,
  headlines,
  desk,
);
document.body.append(main, help, announced);

/** Show one run or two, at the same time and in the same view as those before; without roads, on the same ones. */
function load(scene) {
  const before = views.map(view => view.run);
  if (scene.roads) {
    roadData = scene.roads;
    roads = roadData.map(road => unpackRoad(road, data.steps));
  }
  runs = scene.runs.map(run => unpackRun(run, data));
  for (const run of runs)
    run.collisions = run.rows
      .filter(([level]) => level === "collision")
      .flatMap(([, , subject, bars]) => bars.map(([from, to]) => ({ from, to: to ?? run.end, who: subject.split(" – ") })));
  end = Math.max(...runs.map(run => run.end), 0.01);
  hasEgo = runs.some(run => run.ego !== null && run.tracks.some(each => each.name === run.ego));
  hasPair = runs.some(run => run.partners.some(([, name]) => name));
  place(before, !scene.roads);
  timelines = runs.map((run, i) => new Timeline(run, i, end, seek));
  logs = runs.map((run, i) => new Log(run, i, seek));
  tables = runs.map((run, i) => new Participants(run, i, changed));
  plots = charts(runs, end, seek);
  found = moments(runs);
  const [slid, followed] = [track, whom];
  track = slider(end, found, seek);
  whom = followChoice();
  slid.node.replaceWith(track.node);
  followed.replaceWith(whom);
  headlines.replaceChildren(...runs.map((_, i) => headline(runs, i, seek)));
  column.replaceChildren(
    ...[
      runs.length > 1 ? comparison(runs, plots, seek) : null,
      chartPanel(),
      each("Triggers and actions", timelines),
      each("Event log", logs),
      each("Participants", tables),
    ].filter(Boolean),
  );
  clock.time = Math.min(clock.time, end);
  if (!before.length) begin();
  redraw();
}

/** Give each run a view; those before are kept where as many runs of the same bodies are on the same roads. */
function place(before, sameRoads) {
  const roadOf = run => (run.road === null ? null : roads[run.road]);
  const bodies = run => JSON.stringify(run.tracks.map(({ kind, category, box }) => [kind, category, box]));
  const alike = sameRoads && runs.length === before.length && runs.every((run, i) => bodies(run) === bodies(before[i]));
  const { on } = eye;
  if (!alike) flatten();
  if (runs.length === before.length) views.forEach((view, i) => view.show(runs[i], roadOf(runs[i])));
  else {
    views = runs.map((run, i) => new View(run, roadOf(run), i, changed));
    watch.replaceChildren(...views.map(stage), controls);
    main.classList.toggle("two", runs.length > 1);
    pair.hidden = runs.length < 2;
  }
  if (on && !alike) solid(true);
}

function step(count) {
  play(false);
  seek(clock.time + count * runs[0].sample);
  announce();
}

/** To the next event, or the one before. */
function jump(way) {
  const beyond = ({ time }) => way * (time - clock.time) > 1e-3,
    moment = way > 0 ? found.find(beyond) : found.findLast(beyond);
  if (!moment) return;
  play(false);
  seek(moment.time);
  const lines = runs.flatMap(run =>
    run.events.filter(([time]) => Math.abs(time - moment.time) < 1e-3).map(entry => sentenceOf(run, entry)),
  );
  announced.textContent = `${seconds(moment.time)}. ${lines.join(". ")}`;
}

/** Describe the picture in words, for screen readers. */
function announce() {
  const parts = runs.map((run, i) => {
    const state = run.tracks
      .map(each => [each.name, stateAt(each, Math.min(clock.time, run.end), run.sample)])
      .filter(([, at]) => at);
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

const scaleBy = factor => (eye.on ? nearer : zoom)(factor);

/** Fly the free camera, or do what the key does else; with Shift turn it. */
const flying = (ahead, left, up, otherwise) => event => {
  if (!eye.on || eye.kind !== "free") otherwise?.();
  else if (event.shiftKey && !up) look3(left * 0.1, ahead * 0.08);
  else move(ahead, left, up);
};

const KEYS = {
  " ": () => play(!clock.playing),
  ArrowLeft: event => (event.shiftKey ? seek(clock.time - 1) : step(-1)),
  ArrowRight: event => (event.shiftKey ? seek(clock.time + 1) : step(1)),
  n: () => jump(1),
  p: () => jump(-1),
  Home: () => seek(0),
  End: () => seek(end),
  "+": () => scaleBy(1.25),
  "=": () => scaleBy(1.25),
  "-": () => scaleBy(0.8),
  0: () => (eye.on ? useCamera(eye.kind) : views[0].fit()),
  b: () => choose(hasPair ? "both" : hasEgo ? "ego" : "all"),
  f: () => choose(hasEgo ? "ego" : "all"),
  a: flying(0, 1, 0, () => choose("all")),
  w: flying(1, 0, 0),
  s: flying(-1, 0, 0),
  d: flying(0, -1, 0),
  q: flying(0, 0, -1),
  e: flying(0, 0, 1),
  v: () => solid(!eye.on),
  c: () => useCamera(eye.on ? CAMERAS[(CAMERAS.findIndex(([kind]) => kind === eye.kind) + 1) % 3][0] : eye.kind),
  x: fill,
  "?": toggleHelp,
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
  if (clock.dirty && runs.length) show();
  if (now - clock.written > ADDRESS * 1000) write(now);
  requestAnimationFrame(frame);
}

/** Put the time into the address, so that a link leads to it. */
function write(now) {
  clock.written = now;
  if (location.protocol === "about:") return; // within another page, as in a notebook
  const hash = `#t=${clock.time.toFixed(2)}${eye.on ? `&view=${eye.kind}` : ""}`;
  if (location.hash !== hash && (location.hash || clock.time > 0)) history.replaceState(null, "", hash);
}

function show() {
  clock.dirty = false;
  const { time } = clock;
  for (const view of views) view.place(time);
  aim(views, !clock.playing);
  for (const view of views) view.draw(time);
  for (const part of [...timelines, ...plots]) part.show(time);
  track.input.value = time;
  track.input.setAttribute("aria-valuetext", seconds(time));
  clockText.textContent = `${time.toFixed(2)} / ${seconds(end)}`;
  playButton.textContent = clock.playing ? "Pause" : "Play";
  playButton.setAttribute("aria-label", playButton.textContent);
  if (!clock.playing || Math.abs(time - clock.shown) >= TABLES * clock.rate) {
    clock.shown = time;
    for (const part of [...logs, ...tables]) part.show(time);
    whom.value = chosen();
  }
}

function redraw() {
  const colour = palette();
  for (const view of views) view.colour = colour;
  for (const plot of plots) plot.draw(colour);
  changed();
}

/** Begin at the time and in the view that the address names (#t=5.05&view=chase); with ego and partner, or all, in sight. */
function begin() {
  if (!runs.length) return;
  const address = new URLSearchParams(location.hash.slice(1)),
    given = address.get("t");
  if (given !== null && Number.isFinite(Number(given))) seek(Number(given));
  views[0].fit();
  if (hasEgo) {
    camera.scale = Math.max(camera.scale, usualScale());
    follow(hasPair ? BOTH : "");
  } else follow(ALL);
  if (CAMERAS.some(([kind]) => kind === address.get("view"))) useCamera(address.get("view"));
  redraw();
}

new ResizeObserver(redraw).observe(main);
matchMedia("(prefers-color-scheme: dark)").addEventListener("change", redraw);
addEventListener("hashchange", begin);
if (data.runs) load(data);
requestAnimationFrame(frame);
