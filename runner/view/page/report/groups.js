// Runs by scenario, those with failures first: a matrix where parameters form a grid, else a list of failures.

const WIDEST = 24, // columns of a matrix
  TALLEST = 40,
  HARD = 20, // impact speed (m/s) of the deepest shade
  LISTED = 12; // failures that are listed at most
const cells = { column: columns[0] }; // the measure that cells show

/** Runs by a key, in their order. */
function together(runs, key) {
  const found = new Map();
  for (const run of runs) {
    const of = key(run);
    if (found.has(of)) found.get(of).push(run);
    else found.set(of, [run]);
  }
  return found;
}

/** Values of a parameter among runs, in order. */
function valuesOf(runs, name) {
  const found = [...new Set(runs.map(run => run.parameters[name]).filter(value => value !== undefined))];
  const numbers = found.every(value => typeof value === "number");
  return found.sort((a, b) => (numbers ? a - b : String(a).localeCompare(String(b), "en")));
}

/** What was chosen for the matrix of a scenario: its axes, and the values of parameters that are on none of them. */
const axesOf = new Map();

/** Parameters that vary among runs, with their values, the one with most values first. */
function varying(runs) {
  return data.parameters
    .map(name => ({ name, values: valuesOf(runs, name) }))
    .filter(({ values }) => values.length > 1)
    .sort((a, b) => b.values.length - a.values.length);
}

/** The two parameters that span a grid, those that were chosen first; one alone; null where the runs form no grid. */
function grid(runs, found, { across: chosenAcross, down: chosenDown } = {}) {
  const fits = found.filter(({ values }) => values.length <= TALLEST),
    across = fits.find(({ name }) => name === chosenAcross) ?? fits.find(({ values }) => values.length <= WIDEST);
  const others = fits.filter(each => each !== across),
    down = others.find(({ name }) => name === chosenDown) ?? others[0];
  if (!across) return null;
  const places = across.values.length * (down ? down.values.length : 1);
  const taken = new Set(runs.map(run => place(run, across, down)));
  return chosenAcross || taken.size * 2 >= places ? { across, down } : null;
}

const place = (run, across, down) => JSON.stringify([run.parameters[across.name], down ? run.parameters[down.name] : null]);

/** Choices of axes, and of values of the parameters that are on none, where there are more than two. */
function chooser(name, found, square) {
  if (found.length < 3) return null;
  const chosen = axesOf.get(name) ?? { fixed: {} },
    fits = found.filter(({ values }) => values.length <= TALLEST).map(each => [each.name, each.name]);
  const set = change => {
    axesOf.set(name, { across: square.across.name, down: square.down.name, ...chosen, ...change });
    refresh();
  };
  const swap = (axis, other) => value =>
    set({ [axis]: value, [other]: square[other].name === value ? square[axis].name : square[other].name });
  const rest = found.filter(each => ![square.across, square.down].includes(each));
  return el(
    "div",
    { class: "choices" },
    choice("Across", fits, swap("across", "down"), square.across.name),
    choice("Down", fits, swap("down", "across"), square.down.name),
    ...rest.map(each =>
      choice(
        each.name,
        [["", "all"], ...each.values.map((value, i) => [String(i), String(short(value))])],
        value => set({ fixed: { ...chosen.fixed, [each.name]: value === "" ? undefined : each.values[value] } }),
        String(each.values.indexOf(chosen.fixed[each.name])),
      ),
    ),
  );
}

/** Runs of a scenario as a matrix, with a choice of axes; null where they form no grid. */
function squared(name, runs) {
  const found = varying(runs),
    square = grid(runs, found, axesOf.get(name));
  if (!square) return null;
  const fixed = Object.entries(axesOf.get(name)?.fixed ?? {}).filter(
    ([each, value]) => value !== undefined && ![square.across.name, square.down?.name].includes(each),
  );
  const left = runs.filter(run => fixed.every(([each, value]) => run.parameters[each] === value));
  return el("div", null, chooser(name, found, square), matrix(left, square));
}

function matrix(runs, { across, down }) {
  const rows = down ? down.values : [null],
    places = together(runs, run => place(run, across, down));
  const cell = (x, y) => {
    const there = places.get(JSON.stringify([x, y])) ?? [];
    const where = `${across.name} ${short(x)}${down ? `, ${down.name} ${short(y)}` : ""}`;
    return there.length ? filled(there, where) : el("td", { class: "empty" }, "");
  };
  const heads = [
    el("th", { scope: "col" }, ...(down ? [`${across.name} →`, el("br"), `${down.name} ↓`] : [across.name])),
    ...across.values.map(x => el("th", { scope: "col" }, String(short(x)))),
  ];
  const body = rows.map(y =>
    el("tr", null, el("th", { scope: "row" }, down ? String(short(y)) : ""), ...across.values.map(x => cell(x, y))),
  );
  return wideTable(down ? `${across.name} by ${down.name}` : across.name, heads, el("tbody", null, ...body), "matrix");
}

/** A cell of a matrix: how many of its runs have not passed, and the worst value of one that passed. */
function filled(runs, where) {
  const bad = runs.filter(run => run.state !== "passed").sort(bySeverity),
    first = bad[0] ?? runs[0],
    speed = first.measures.impact_speed,
    kind = bad.length ? (bad.length < runs.length ? "mixed" : first.state) : "passed";
  const one = typeof speed === "number" ? `✕ ${speed.toFixed(0)}` : "✕",
    cross = runs.length > 1 ? `✕ ${bad.length}/${runs.length}` : one;
  const text = bad.length ? cross : shown(cells.column, first);
  const label = `${where}: ${bad.length ? `${bad.length} of ${runs.length} ${called(bad)}, ${reason(first)}` : "passed"}`;
  const inner = first.replay
    ? el("a", { href: link(first), "aria-label": label }, text)
    : el("span", { role: "img", "aria-label": label }, text);
  const shade = typeof speed === "number" && bad.length ? Math.round(100 * Math.min(1, speed / HARD)) : null;
  return el("td", { class: kind, title: label, style: shade === null ? null : `--shade:${shade}%` }, inner);
}

/** Why a run failed, without the numbers and files in which failures of one kind differ. */
const cause = run => reason(run).split("; ")[0].replace(/^\S+\.xo(sc|dr)(:\d+)?: /, "").replace(/-?\b\d+(\.\d+)?\b/g, "…");

const item = run => el("li", null, named(run), " ", el("span", { class: "muted" }, reason(run)));

/** Runs that have not passed, those of one cause folded; what is open stays so. */
function failures(name, runs, open) {
  const bad = runs.filter(run => run.state !== "passed").sort(bySeverity),
    causes = [...together(bad, cause)].sort(([, a], [, b]) => b.length - a.length);
  if (bad.length <= 3) return el("ul", { class: "failures" }, ...bad.map(item));
  return el(
    "div",
    { class: "failures" },
    ...causes.slice(0, LISTED).map(([text, those]) => {
      const key = JSON.stringify([name, text]);
      const list = () => [
        ...those.slice(0, LISTED).map(item),
        those.length > LISTED ? el("li", { class: "muted" }, `and ${those.length - LISTED} more in the table below`) : "",
      ];
      const node = el(
        "details",
        { class: "cause", open: open.get(key) },
        el("summary", null, el("span", { class: "count" }, many(those.length, "run")), text),
        el("ul", null, ...(open.get(key) ? list() : [])),
      );
      node.addEventListener("toggle", () => {
        open.set(key, node.open);
        if (node.open) node.lastChild.replaceChildren(...list());
      });
      return node;
    }),
    causes.length > LISTED ? el("p", { class: "muted" }, `and ${causes.length - LISTED} more causes in the table below`) : null,
  );
}

function group(name, runs, open) {
  const others = runs.filter(run => run.state !== "passed"),
    bad = others.length,
    opened = open.has(name) ? open.get(name) : bad > 0,
    body = el("div");
  const fill = () => {
    const square = squared(name, runs);
    const passed = () => el("p", null, ...runs.slice(0, LISTED).flatMap((run, i) => [i ? ", " : "", named(run)]));
    body.replaceChildren(...[square, bad ? failures(name, runs, open) : null, !bad && !square ? passed() : null].filter(Boolean));
  };
  const node = el(
    "details",
    { class: "group", open: opened },
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
    body,
  );
  if (opened) fill(); // what is closed is not made before it is opened
  node.addEventListener("toggle", () => {
    open.set(name, node.open);
    if (node.open && !body.firstChild) fill();
  });
  return node;
}

function groups() {
  const box = el("div"),
    open = new Map(); // what the user has opened and closed
  const fill = runs => {
    const bad = each => each.filter(run => run.state !== "passed").length;
    const sorted = [...together(runs, run => run.group)].sort(([, a], [, b]) => bad(b) - bad(a));
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
