// The assessment of a batch by a protocol: tests with results and points, every run, what is not assessed, what it is traced by.

const data = JSON.parse(document.getElementById("data").textContent);
const RESULTS = ["met", "partly met", "not met", "not assessed"];
const BADGES = { met: "passed", "partly met": "inconclusive", "not met": "failed", "not assessed": "open" };
const PAGE = 200; // rows that are shown at first
const many = (count, one, several = `${one}s`) => `${count.toLocaleString("en")} ${count === 1 ? one : several}`;
const badge = result => el("span", { class: `badge ${BADGES[result]}` }, result);
const points = value => (value === null ? "" : String(Number(value.toFixed(3))));
const chosen = { test: "", result: "" };

/** Points of a run, of those that its test point stands for. */
const share = run => (run.available === null ? "–" : `${points(run.points) || "?"} of ${points(run.available)}`);

/** Points of a test, or the least and the most where results are open. */
const range = (least, most) => (most - least < 1e-9 ? points(least) : `${points(least)} to ${points(most)}`);

function tabled(label, heads, rows, kind = "") {
  const cells = heads.map(([text, number]) => el("th", { scope: "col", class: number }, text));
  const region = wideTable(label, cells, el("tbody", null, ...rows));
  if (kind) region.classList.add(kind);
  return region;
}

const row = (...cells) => el("tr", null, ...cells);
const cell = (content, kind) => el("td", kind ? { class: kind } : null, content);
const panel = (title, ...parts) => el("section", { class: "panel" }, el("h2", null, title), ...parts.filter(Boolean));

function summary() {
  const tests = data.tests.filter(test => test.runs),
    rated = tests.filter(test => test.points),
    missing = data.tests.filter(test => !test.runs);
  const sum = name => rated.reduce((total, test) => total + test[name], 0),
    available = sum("points"),
    open = data.absent.reduce((total, part) => total + part.points, 0) + missing.reduce((total, test) => total + test.points, 0);
  const heads = [["test"], ["criterion"], ["runs", "number"], ...RESULTS.map(result => [result, "number"])];
  if (rated.length) heads.push(["test points", "number"], ["points", "number"]);
  const rows = tests.map(test =>
    row(
      el("td", { class: "name" }, el("strong", null, test.name), ` ${test.title}`, el("div", { class: "muted" }, test.clause)),
      el("td", { class: "why" }, test.criterion, test.remark ? el("div", { class: "muted" }, test.remark) : null),
      cell(String(test.runs), "number"),
      ...RESULTS.map(result => cell(String(test.results[result] || "–"), "number")),
      ...(rated.length
        ? [
            cell(test.size ? `${test.covered} of ${test.size}` : "–", "number"),
            cell(test.points ? `${range(test.least, test.most)} of ${points(test.points)}` : "–", "number"),
          ]
        : []),
    ),
  );
  return panel(
    `${many(data.rows.length, "run")} of ${many(tests.length, "test")}`,
    rated.length
      ? el(
          "p",
          { class: "verdict" },
          `${range(sum("least"), sum("most"))} of ${points(available)} points`,
          el("span", { class: "muted" }, open ? `; ${points(open)} points of the protocol are not assessed` : ""),
        )
      : el("p", { class: "muted" }, "No points: the protocol has none, or its rule is not public."),
    tabled("Tests", heads, rows),
    missing.length ? el("p", { class: "muted" }, `Tests without a run: ${missing.map(test => test.name).join(", ")}.`) : null,
  );
}

/** The grid of a test with two parameters, as the protocol prints it; null for another one. */
function grid(test) {
  const names = Object.keys(test.grid);
  if (names.length !== 2) return null;
  const [down, across] = names.map(name => [...test.grid[name]].sort((a, b) => a - b));
  const at = (y, x) => data.rows.filter(run => run.test === test.name && run.point && run.point[0] === y && run.point[1] === x);
  const filled = (y, x) => {
    const runs = at(y, x),
      worst = RESULTS.toReversed().find(result => runs.some(run => run.result === result)),
      first = runs.find(run => run.result === worst);
    if (!first) return el("td", { class: "empty", title: "not run" }, "");
    const text = first.colour || { met: "✓", "partly met": "½", "not met": "✕", "not assessed": "?" }[worst];
    const label = `${names[0]} ${y}, ${names[1]} ${x}: ${worst}; ${first.reason}`;
    return el("td", { class: BADGES[worst], title: label }, el("span", { role: "img", "aria-label": label }, text));
  };
  return el(
    "details",
    { class: "group", open: true },
    el("summary", null, el("h3", null, test.name)),
    wideTable(
      `Grid of ${test.name}`,
      [
        el("th", { scope: "col" }, `${names[1]} →`, el("br"), `${names[0]} ↓`),
        ...across.map(x => el("th", { scope: "col" }, String(x))),
      ],
      el("tbody", null, ...down.map(y => row(el("th", { scope: "row" }, String(y)), ...across.map(x => filled(y, x))))),
      "matrix",
    ),
  );
}

function grids() {
  const found = data.tests.filter(test => test.runs).map(grid).filter(Boolean);
  return found.length ? panel("Test points", ...found) : null;
}

function choice(label, options, change) {
  const select = el(
    "select",
    { "aria-label": label, change: () => change(select.value) },
    ...options.map(([value, text]) => el("option", { value }, text)),
  );
  return el("label", null, label, select);
}

function runs() {
  const rated = data.rows.some(run => run.available !== null),
    others = data.rows.some(run => run.others);
  const heads = [["test"], ["run"], ...data.columns.map(title => [title, "number"]), ...(others ? [["other parameters"]] : [])];
  heads.push(["outcome"], ["result"], ["reason"], ...(rated ? [["points", "number"]] : []));
  const body = el("tbody"),
    told = el("p", { class: "muted", "aria-live": "polite" });
  let count = PAGE;
  const more = el("button", { click: () => ((count += 5 * PAGE), fill()) }, "Show more");
  const line = run =>
    row(
      cell(run.test ?? "–"),
      cell(run.replay ? el("a", { href: run.replay.split("/").map(encodeURIComponent).join("/") }, run.name) : run.name, "name"),
      ...run.cells.map(value => cell(String(short(value)), "number")),
      ...(others ? [cell(run.others, "muted why")] : []),
      cell(run.outcome),
      el("td", null, badge(run.result), run.colour ? ` ${run.colour}` : null),
      cell(run.reason, "why muted"),
      ...(rated ? [cell(share(run), "number")] : []),
    );
  function fill() {
    const found = data.rows.filter(
      run => (!chosen.test || (run.test ?? "–") === chosen.test) && (!chosen.result || run.result === chosen.result),
    );
    body.replaceChildren(...found.slice(0, count).map(line));
    more.hidden = found.length <= count;
    told.textContent = `${Math.min(count, found.length)} of ${many(found.length, "run")}`;
  }
  const set = name => value => ((chosen[name] = value), (count = PAGE), fill());
  fill();
  const tests = [...new Set(data.rows.map(run => run.test ?? "–"))];
  const table = tabled("Runs", heads, [], "runs");
  table.querySelector("tbody").replaceWith(body);
  return panel(
    "Runs",
    el(
      "div",
      { class: "choices" },
      choice("Test", [["", "all"], ...tests.map(name => [name, name])], set("test")),
      choice("Result", [["", "all"], ...RESULTS.map(name => [name, name])], set("result")),
      told,
    ),
    table,
    more,
  );
}

const list = texts => el("ul", null, ...texts.map(text => el("li", null, text)));

function absent() {
  if (!data.absent.length) return null;
  const rows = data.absent.map(part =>
    row(cell(part.name), cell(part.points ? points(part.points) : "–", "number"), cell(part.reason)),
  );
  return panel("Not assessed", tabled("Not assessed", [["part of the protocol"], ["points", "number"], ["reason"]], rows));
}

function trace() {
  const entries = Object.entries(data.trace).flatMap(([name, value]) => [el("dt", null, name), el("dd", null, value)]);
  const files = data.files.map(({ path, sha256 }) => row(cell(path, "name"), cell(el("code", null, sha256 || "gone"))));
  return panel(
    "Traceability",
    el("dl", null, ...entries),
    el("h3", null, many(data.files.length, "file")),
    tabled("Files", [["file"], ["SHA-256"]], files),
  );
}

document.body.append(
  el(
    "main",
    { id: "page" },
    ...[
      el("header", null, el("h1", null, data.title), el("p", { class: "muted" },
        `Batch ${data.batch}, system under test ${data.trace["system under test"]}, ${data.trace.tool}. Simulated; no rating.`)),
      summary(),
      grids(),
      runs(),
      absent(),
      panel("Assumptions", list(data.assumptions)),
      trace(),
      panel("Sources", list(data.sources)),
    ].filter(Boolean),
  ),
);
