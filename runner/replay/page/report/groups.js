// Runs by scenario, those with failures first: a matrix where parameters form a grid, else a list of failures.

const WIDEST = 24, // columns of a matrix
  TALLEST = 40,
  HARD = 20, // impact speed (m/s) of the deepest shade
  LISTED = 12; // failures that are listed at most
const cells = { column: columns[0] }; // the measure that cells show

/** Values of a parameter among runs, in order. */
function valuesOf(runs, name) {
  const found = [...new Set(runs.map(run => run.parameters[name]).filter(value => value !== undefined))];
  const numbers = found.every(value => typeof value === "number");
  return found.sort((a, b) => (numbers ? a - b : String(a).localeCompare(String(b), "en")));
}

/** The two parameters that span a grid, the one with more values across; one alone; null where the runs form no grid. */
function grid(runs) {
  const varying = data.parameters
    .map(name => ({ name, values: valuesOf(runs, name) }))
    .filter(({ values }) => values.length > 1)
    .sort((a, b) => b.values.length - a.values.length);
  const [across, down] = varying.filter(({ values }, i) => values.length <= (i ? TALLEST : WIDEST));
  if (!across) return null;
  const places = across.values.length * (down ? down.values.length : 1);
  const taken = new Set(runs.map(run => JSON.stringify([run.parameters[across.name], down && run.parameters[down.name]])));
  return taken.size * 2 >= places ? { across, down } : null;
}

function matrix(runs, { across, down }) {
  const rows = down ? down.values : [null];
  const cell = (x, y) => {
    const there = runs.filter(
      run => run.parameters[across.name] === x && (!down || run.parameters[down.name] === y),
    );
    const where = `${across.name} ${short(x)}${down ? `, ${down.name} ${short(y)}` : ""}`;
    return there.length ? filled(there, where) : el("td", { class: "empty" }, "");
  };
  const head = el(
    "tr",
    null,
    el("th", { scope: "col" }, ...(down ? [`${across.name} →`, el("br"), `${down.name} ↓`] : [across.name])),
    ...across.values.map(x => el("th", { scope: "col" }, String(short(x)))),
  );
  return el(
    "div",
    { class: "wide", tabindex: 0, role: "region", "aria-label": down ? `${across.name} by ${down.name}` : across.name },
    el(
      "table",
      { class: "matrix" },
      el("thead", null, head),
      el(
        "tbody",
        null,
        ...rows.map(y =>
          el("tr", null, el("th", { scope: "row" }, down ? String(short(y)) : ""), ...across.values.map(x => cell(x, y))),
        ),
      ),
    ),
  );
}

/** A cell of a matrix: how many of its runs have not passed, and the worst value of one that passed. */
function filled(runs, where) {
  const bad = runs.filter(run => run.state !== "passed").sort(bySeverity),
    first = bad[0] ?? runs[0],
    speed = first.measures.impact_speed,
    kind = bad.length ? (bad.length < runs.length ? "mixed" : first.state) : "passed";
  const cross = runs.length > 1 ? `✕ ${bad.length}/${runs.length}` : typeof speed === "number" ? `✕ ${speed.toFixed(0)}` : "✕";
  const text = bad.length ? cross : shown(cells.column, first, 3);
  const label = `${where}: ${bad.length ? `${bad.length} of ${runs.length} ${called(bad)}, ${reason(first)}` : "passed"}`;
  const inner = first.replay
    ? el("a", { href: link(first), "aria-label": label }, text)
    : el("span", { role: "img", "aria-label": label }, text);
  const shade = typeof speed === "number" && bad.length ? Math.round(100 * Math.min(1, speed / HARD)) : null;
  return el("td", { class: kind, title: label, style: shade === null ? null : `--shade:${shade}%` }, inner);
}

function failures(runs) {
  const bad = runs.filter(run => run.state !== "passed").sort(bySeverity);
  return el(
    "ul",
    { class: "failures" },
    ...bad.slice(0, LISTED).map(run => el("li", null, named(run), " ", el("span", { class: "muted" }, reason(run)))),
    bad.length > LISTED ? el("li", { class: "muted" }, `and ${bad.length - LISTED} more in the table below`) : null,
  );
}

function group(name, runs, open) {
  const others = runs.filter(run => run.state !== "passed"),
    bad = others.length,
    square = grid(runs);
  const node = el(
    "details",
    { class: "group", open: open.has(name) ? open.get(name) : bad > 0 },
    el(
      "summary",
      null,
      el(
        "span",
        { class: `count ${bad ? (others.every(run => run.state === "inconclusive") ? "inconclusive" : "failed") : "passed"}` },
        bad ? `${bad} of ${runs.length} ${called(others)}` : `${runs.length} passed`,
      ),
      el("h3", null, name),
    ),
    square ? matrix(runs, square) : null,
    bad && (!square || runs.length === 1) ? failures(runs) : null,
    !bad && !square ? el("p", null, ...runs.slice(0, LISTED).flatMap((run, i) => [i ? ", " : "", named(run)])) : null,
  );
  node.addEventListener("toggle", () => open.set(name, node.open));
  return node;
}

function groups() {
  const box = el("div"),
    open = new Map(); // what the user has opened and closed
  const fill = runs => {
    const found = new Map();
    for (const run of runs) found.set(run.group, [...(found.get(run.group) ?? []), run]);
    const bad = each => each.filter(run => run.state !== "passed").length;
    const sorted = [...found].sort(([, a], [, b]) => bad(b) - bad(a));
    box.replaceChildren(...sorted.map(([name, each]) => group(name, each, open)));
  };
  listeners.push(fill);
  const measures = columns.filter(column => column.id in data.measures && column.numbers);
  return el(
    "section",
    { class: "panel" },
    el("h2", null, "By scenario, failures first"),
    el(
      "div",
      { class: "choices" },
      el(
        "span",
        { class: "muted" },
        "A cross is a failure, with its impact speed (m/s), the deeper the harder, or an inconclusive run; runs that passed show",
      ),
      choice(
        "Measure",
        measures.map(column => [column.id, column.title]),
        id => {
          cells.column = columns.find(column => column.id === id);
          refresh();
        },
      ),
    ),
    box,
  );
}
