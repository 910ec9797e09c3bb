// Labelling page: one item at a time, its film, keys for answers, a table of answers to download.

const LETTERS = "abcdefghijklmnopq";
const ANSWERS = { r: "right", w: "wrong", u: "unclear" };
const KEEP = `judging ${location.pathname} ${data.items.length} ${data.items[0]?.text.length}`;
const state = { item: 0, answers: restored(), choosing: false, paused: false, time: 0, last: 0 };

/** Answers kept by the browser: per item a verdict, a reason, and events. */
function restored() {
  const empty = () => ({ verdict: "", reason: "", events: [] });
  let kept = [];
  try {
    kept = JSON.parse(localStorage.getItem(KEEP)) ?? [];
  } catch {
    kept = [];
  }
  return data.items.map((_, item) => kept[item] ?? empty());
}

function keepAnswers() {
  try {
    localStorage.setItem(KEEP, JSON.stringify(state.answers));
  } catch {
    // private windows keep nothing; the table can still be saved
  }
}

const film = () => filmOf(state.item);
const time = () => films.current.start + middle() + state.time;
const films = { current: null };
/** Time (s) in the recording of the event that a film is about. */
const middle = () => data.times[state.item];
const filled = item => state.answers[item].verdict !== "";

function answer(verdict) {
  state.answers[state.item].verdict = verdict;
  keepAnswers();
  show(Math.min(state.item + 1, data.items.length - 1));
}

/** Enter an event of a class at the film's time. */
function enter(name) {
  state.answers[state.item].events.push([name, time().toFixed(1)]);
  state.choosing = false;
  keepAnswers();
  describe();
}

function remove(index) {
  state.answers[state.item].events.splice(index, 1);
  keepAnswers();
  describe();
}

/** Table of answers: a row with the verdict of each answered item, and one for each event entered. */
function table() {
  const quoted = text => (/[",\n]/.test(text) ? `"${text.replaceAll('"', '""')}"` : text);
  const rows = [data.columns];
  state.answers.forEach(({ verdict, reason, events }, item) => {
    if (verdict) rows.push([item, verdict, "", "", reason]);
    for (const [name, at] of events) rows.push([item, "event", name, at, ""]);
  });
  return rows.map(row => row.map(cell => quoted(String(cell))).join(",") + "\n").join("");
}

function save() {
  const link = el("a", { href: URL.createObjectURL(new Blob([table()], { type: "text/csv" })), download: "answers.csv" });
  link.click();
  URL.revokeObjectURL(link.href);
}

const act = {
  r: () => data.items[state.item].title && answer("right"),
  w: () => data.items[state.item].title && answer("wrong"),
  u: () => answer("unclear"),
  Enter: () => (data.items[state.item].title ? show(state.item + 1) : answer("complete")),
  m: () => choose(true),
  Escape: () => choose(false),
  p: () => show(state.item - 1),
  n: () => show(state.item + 1),
  s: save,
  " ": () => (state.paused = !state.paused),
  ArrowLeft: () => step(-data.step),
  ArrowRight: () => step(data.step),
};

function choose(on) {
  state.choosing = on;
  describe();
}

function step(by) {
  state.paused = true;
  state.time = Math.min(Math.max(state.time + by, 0), films.current.duration);
}

document.addEventListener("keydown", event => {
  if (event.target.tagName === "INPUT" || event.ctrlKey || event.metaKey || event.altKey) return;
  const letter = LETTERS.indexOf(event.key);
  if (state.choosing && letter >= 0 && letter < data.classes.length) enter(data.classes[letter]);
  else if (act[event.key]) act[event.key]();
  else return;
  event.preventDefault();
});

function show(item) {
  if (item < 0 || item >= data.items.length) return;
  Object.assign(state, { item, choosing: false, paused: false, time: 0 });
  films.current = film();
  describe();
}

const button = (key, text, chosen) =>
  el("button", { type: "button", class: chosen && "chosen", click: () => act[key]() }, `${text} (${key === " " ? "space" : key})`);

/** The item as text: the question, answers, events, numbers. */
function describe() {
  const { title, text } = data.items[state.item],
    { verdict, reason, events } = state.answers[state.item];
  const done = state.answers.filter(each => each.verdict).length;
  const question = title ? `Is this ${title}?` : "Which events happen to the blue vehicle?";
  const answers = title
    ? Object.entries(ANSWERS).map(([key, name]) => button(key, name, verdict === name))
    : [button("Enter", "complete", verdict === "complete"), button("u", "unclear", verdict === "unclear")];
  const classes = data.classes.map((name, i) =>
    el("li", null, el("button", { type: "button", click: () => enter(name) }, `${LETTERS[i]}  ${name}`)),
  );
  const listed = events.map(([name, at], i) =>
    el("li", null, `${name} at ${at} s `, el("button", { type: "button", click: () => remove(i) }, "remove")),
  );
  side.replaceChildren(
    ...[
      el("h2", null, `${state.item + 1} of ${data.items.length}: ${question}`),
      el("p", { class: "muted", role: "status" }, `${done} answered`),
      el("div", { class: "keys" }, ...answers),
      el("div", { class: "keys" }, button("m", title ? "missed event" : "event", state.choosing), button(" ", "pause"), button("p", "back"), button("n", "next"), button("s", "save CSV")),
      state.choosing && el("ul", { id: "classes" }, ...classes),
      el("ul", null, ...listed),
      el("label", null, "reason ", el("input", { value: reason, input: event => { state.answers[state.item].reason = event.target.value; keepAnswers(); } })),
      el("pre", { id: "numbers", tabindex: 0 }, text),
    ].filter(Boolean),
  );
}

const canvas = el("canvas", { id: "film", click: () => act[" "](), "aria-label": "film of the item" }),
  side = el("section");
document.body.append(el("main", null, el("h1", null, document.title), el("div", { class: "judging" }, canvas, side)));

/** Play the film at twice the recorded speed, from its beginning again at its end. */
function advance(now) {
  if (!state.paused) state.time = (state.time + Math.min((now - state.last) / 1000, 0.1) * 2) % (films.current.duration + 0.5);
  state.last = now;
  drawFilm(canvas, films.current, Math.min(state.time, films.current.duration));
  requestAnimationFrame(advance);
}

show(Math.max(data.items.findIndex((_, item) => !filled(item)), 0));
requestAnimationFrame(advance);
