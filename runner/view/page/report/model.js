// The runs of a batch, what they are placed, sorted and counted by, and which of them are looked at.

const data = JSON.parse(document.getElementById("data").textContent);
const STATES = ["failed", "error", "inconclusive", "passed"]; // the gravest first
const address = path => path.split("/").map(part => (part === ".." ? part : encodeURIComponent(part))).join("/");
const link = run => `${address(run.replay)}#t=${run.moment}`;
const many = (count, one, several = `${one}s`) => `${count.toLocaleString("en")} ${count === 1 ? one : several}`;

const PLACES = { s: 2, m: 2, "m/s": 1, "m/s²": 2, "%": 1 }; // decimals by unit

/** A measure as a column; shares are in per cent. */
function measured([name, { label, unit: given, most: end, beyond }]) {
  const share = !given && end === 1,
    [unit, factor] = share ? ["%", 100] : [given, 1];
  const times = value => (typeof value === "number" ? factor * value : value);
  return {
    id: name,
    title: unit ? `${label} (${unit})` : label,
    unit,
    most: factor * end,
    beyond,
    of: run => times(run.measures[name]),
    before: run => times(run.before.measures[name]),
  };
}

/** A name, a title with its unit, the value of a run, and from which value on it is called something else. */
const columns = [
  ...Object.entries(data.measures).map(measured),
  { id: "end", title: "End (s)", unit: "s", of: run => run.end },
  ...data.parameters.map(name => ({ id: `p:${name}`, title: name, parameter: true, of: run => run.parameters[name] ?? null })),
];
for (const column of columns) column.numbers = data.runs.filter(run => typeof column.of(run) === "number").length;
const numeric = columns.filter(column => column.numbers).sort((a, b) => !a.parameter - !b.parameter || b.numbers - a.numbers);

/** A value of a column as text, with the decimals of its unit. */
function sized(column, value) {
  const places = PLACES[column.unit];
  if (typeof value !== "number" || places === undefined) return String(short(value));
  if (column.beyond && value > column.most) return column.beyond;
  return column.unit === "%" && value > 0 && value < 0.1 ? "<0.1" : value.toFixed(Math.abs(value) < 100 ? places : 0);
}

/** A run's value in a column as text. */
const shown = (column, run) => sized(column, column.of(run));

/** Runs by severity: failures first, those with the greatest risk of a death first among them, then the nearest misses. */
function bySeverity(a, b) {
  const state = STATES.indexOf(a.state) - STATES.indexOf(b.state);
  if (state) return state;
  const of = (run, name, absent) => run.measures[name] ?? absent;
  return (
    of(b, "fatality_risk", -1) - of(a, "fatality_risk", -1) ||
    of(b, "impact_speed", -1) - of(a, "impact_speed", -1) ||
    of(a, "min_distance", Infinity) - of(b, "min_distance", Infinity)
  );
}

/** What runs that have not passed are called together. */
const called = bad => (bad.some(run => run.state === "inconclusive") ? "not passed" : "failed");

/** Why a run ended as it did. */
const reason = run => run.message || (ENDS[run.status] ?? run.status);

// filters -------------------------------------------------------------------------------------

const filter = { words: "", state: "", group: "", meets: null };
const listeners = []; // what is filled anew when the filter changes
const drawings = []; // what is drawn anew when the page's size or colours change, too

/** The runs that the filter leaves. */
function chosen() {
  const words = filter.words.toLowerCase();
  return data.runs.filter(
    run =>
      (!filter.state || run.state === filter.state) &&
      (!filter.group || run.group === filter.group) &&
      (!filter.meets || filter.meets(run)) &&
      `${run.name} ${run.message}`.toLowerCase().includes(words),
  );
}

function refresh() {
  const runs = chosen();
  for (const listener of [...listeners, ...drawings]) listener(runs);
}

function redraw() {
  const runs = chosen();
  for (const drawing of drawings) drawing(runs);
}

/** A choice with a label; options are [value, text]. */
function choice(label, options, change, initial) {
  const select = el(
    "select",
    { "aria-label": label, change: () => change(select.value) },
    ...options.map(([value, text]) => el("option", { value, selected: value === initial }, text)),
  );
  return el("label", null, label, select);
}

/** Columns for questions with their types, by the names of the table of runs. */
function kindsOfRuns() {
  const texts = ["name", "scenario", "state", "verdict", "status", "message"].map(each => [each, "text"]),
    measures = ["end_time", ...Object.keys(data.measures)].map(each => [each, "number"]);
  const names = [...new Set(data.runs.flatMap(run => Object.keys(run.parameters)))];
  const parameters = names.map(each => [each, kindOf(data.runs.map(run => run.parameters[each]))]);
  return new Map([...parameters, ...texts, ...measures]);
}

const KINDS = kindsOfRuns();

/** A run's value in a column of the table of runs. */
function valueOf(run, name) {
  if (name === "end_time") return run.end;
  if (name === "scenario") return run.scenario;
  if (name in data.measures) return run.measures[name];
  const value = ["name", "state", "verdict", "status", "message"].includes(name) ? run[name] : run.parameters[name];
  return KINDS.get(name) === "text" && typeof value === "number" ? String(value) : value;
}

function filters() {
  const groups = [...new Set(data.runs.map(run => run.group))];
  const told = el("span", { class: "muted", "aria-live": "polite" });
  const set = name => value => {
    filter[name] = value;
    refresh();
  };
  const search = el("input", {
    type: "search",
    "aria-label": "Find runs",
    placeholder: "find by name or reason",
    input: () => set("words")(search.value),
  });
  listeners.push(runs => {
    told.textContent = `${runs.length} of ${many(data.runs.length, "run")}`;
  });
  return el(
    "div",
    { class: "panel choices filters", role: "search", "aria-label": "Filters of everything below" },
    search,
    choice("Verdict", [["", "all"], ...STATES.map(each => [each, each])], set("state")),
    groups.length > 1 ? choice("Scenario", [["", "all"], ...groups.map(each => [each, each])], set("group")) : null,
    ...questionBox(KINDS, valueOf, "min_ttc < 1 and state = 'failed'", set("meets")),
    told,
  );
}
