// What all parts of a loop's page share: its data, searches by round, links, tables. Codes of the data become words here.

const data = JSON.parse(document.getElementById("data").textContent);
const STATES = ["known", "discovered", "unknown"];
const sum = numbers => numbers.reduce((a, b) => a + b, 0);
const many = (count, one, several = `${one}s`) => `${count.toLocaleString("en")} ${count === 1 ? one : several}`;
const link = path => {
  const [file, hash] = path.split("#");
  return file.split("/").map(encodeURIComponent).join("/") + (hash ? `#${hash}` : "");
};
const redraws = [];

const badge = (kind, text) => el("span", { class: `badge ${kind}` }, text);
const play = (path, name) =>
  path
    ? el("a", { class: "play", href: link(path), "aria-label": `Play ${name}` }, "▶ Play")
    : el("span", { class: "muted" }, "no replay");
const FILES = { scenario: ".xosc", manoeuvre: "manoeuvre", road: ".xodr", tags: "tags" };
const files = (each, name) =>
  el(
    "td",
    { class: "files" },
    ...Object.entries(each).map(([kind, path]) => el("a", { href: link(path), "aria-label": `${kind} of ${name}` }, FILES[kind])),
  );

/** A table in a region of its own that scrolls; columns are [title, class]. */
function table(label, columns, rows) {
  const head = el("tr", null, ...columns.map(([title, kind]) => el("th", { scope: "col", class: kind }, title)));
  return el(
    "div",
    { class: "wide", tabindex: 0, role: "region", "aria-label": label },
    el("table", null, el("thead", null, head), el("tbody", null, ...rows)),
  );
}
const number = value => el("td", { class: "number" }, String(short(value)));

const scenarios = state => sum(data.classes.filter(each => each.state === state).map(each => each.count));
const done = data.searches.filter(search => !search.error),
  last = Math.max(1, ...done.map(search => search.round));
const rounds = Array.from({ length: last }, (_, i) => done.filter(search => search.round === i + 1));
const cases = done.flatMap(search => search.cases),
  total = (searches, key) => sum(searches.map(search => search[key]));

const VERDICTS = { collision: ["failed", "collision"], violation: ["unknown", "RSS violated"] };
const CAREFUL = { avoids: "avoids a collision", collides: "collides too", unknown: "unknown: the run failed" };
const REPORTS = {
  played: () => "replays of recorded scenarios",
  cases: ({ round }) => `runs of edge cases, round ${round}`,
  scenarios: () => "runs of your scenarios",
};
const verdict = each => VERDICTS[each.verdict];
const priorOf = ({ manoeuvres, own }) => `${manoeuvres} manoeuvres ${own ? "of these recordings" : "shipped with the package"}`;
