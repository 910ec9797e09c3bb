// What all parts of a loop's page share: its data, searches by round, links, tables. Codes of the data become words here.

const data = JSON.parse(document.getElementById("data").textContent);
const STATES = ["known", "discovered", "unknown"];
const sum = numbers => numbers.reduce((a, b) => a + b, 0);

const scenarios = state => sum(data.classes.filter(each => each.state === state).map(each => each.count));
const collided = target => sum(data.searches.filter(search => search.target === target).map(search => search.collisions ?? 0));
const done = data.searches
    .filter(search => !search.error)
    .sort((a, b) => collided(b.target) - collided(a.target) || a.round - b.round), // failures come first
  last = Math.max(1, ...done.map(search => search.round));
const rounds = Array.from({ length: last }, (_, i) => done.filter(search => search.round === i + 1));
const cases = done.flatMap(search => search.cases),
  total = (searches, key) => sum(searches.map(search => search[key]));

const VERDICTS = { collision: ["failed", "collision"], violation: ["unknown", "RSS violated"] };
const CAREFUL = { avoids: "no collision either", collides: "collides too", unknown: "unknown: the run failed" };
const REPORTS = {
  played: () => "replays of recorded scenarios",
  cases: ({ round }) => `runs of edge cases, round ${round}`,
  scenarios: () => "runs of your scenarios",
};
const verdict = each => VERDICTS[each.verdict];
const title = `from ${data.recordings ? "recordings" : "scenarios"} to edge cases`;
const priorOf = ({ manoeuvres, own }) =>
  manoeuvres
    ? `${many(manoeuvres, "manoeuvre")} ${own ? "of these recordings" : "shipped with the package"}`
    : "what is stated, without recordings";
