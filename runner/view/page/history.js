// Runs of several batches: a row a run, a column a version; rows that change come first.

const data = JSON.parse(document.getElementById("data").textContent);
const STATES = ["failed", "error", "inconclusive", "passed"]; // the gravest first
const PAGE = 200; // rows that are shown at first
const many = (count, one) => `${count.toLocaleString("en")} ${one}${count === 1 ? "" : "s"}`;
const MARKS = { impact_speed: ["m/s impact", 1], min_distance: ["m", 2], min_ttc: ["s TTC", 2] }; // unit, decimals
const filter = { words: "", kind: "" };

/** What became of a run between two versions: new failure (also of changed files), fixed, still failing, or nothing. */
const fails = cell => cell !== null && cell.state !== "passed";
function fate(cells) {
  const [before, now] = cells.slice(-2);
  if (before === null || now === null) return before === now ? "" : now ? "added" : "removed";
  const known = fails(before) && before.content === now.content && !(now.state === "failed" && before.state !== "failed");
  return fails(now) ? (known ? "still failing" : "new failure") : fails(before) ? "fixed" : "";
}
const changes = cells => new Set(cells.map(cell => cell?.state ?? "")).size > 1;
const ORDER = ["new failure", "fixed", "still failing", "added", "removed", ""];
for (const row of data.rows) row.fate = fate(row.cells);
const rank = row => 2 * ORDER.indexOf(row.fate) - changes(row.cells);
data.rows.sort((a, b) => rank(a) - rank(b) || a.name.localeCompare(b.name, "en"));

function versions() {
  const columns = data.versions.map(({ title, system, tool, report, counts }) => {
    const total = Object.values(counts).reduce((a, b) => a + b, 0);
    return el(
      "div",
      null,
      el("h3", null, report ? el("a", { href: report }, title) : title),
      el(
        "div",
        { class: "share", role: "img", "aria-label": STATES.map(state => `${counts[state] ?? 0} ${state}`).join(", ") },
        ...STATES.map(state => el("i", { style: `width:${(100 * (counts[state] ?? 0)) / total}%;background:var(--${state})` })),
      ),
      el("p", null, STATES.filter(state => counts[state]).map(state => `${counts[state]} ${state}`).join(", ")),
      el("p", { class: "muted" }, `${system}${tool ? `, xosc-toolchain ${tool}` : ""}`),
    );
  });
  const [worse, fixed, still] = ORDER.slice(0, 3).map(name => data.rows.filter(row => row.fate === name).length);
  const counts = [many(worse, "new failure"), `${fixed} fixed`, `${still} still failing`];
  return el(
    "section",
    { class: "panel" },
    el("h2", { class: "verdict" }, `${data.versions.at(-1).title} against ${data.versions.at(-2).title}: ${counts.join(", ")}`),
    el("div", { class: "histograms" }, ...columns),
  );
}

function cell(found) {
  if (found === null) return el("td", { class: "muted" }, "–");
  const [unit, places] = found.measure ? MARKS[found.measure[0]] : [];
  const measure = unit ? `${found.measure[1].toFixed(places)} ${unit}` : "play";
  const state = el("span", { class: `badge ${found.state}`, title: found.message || null }, found.state);
  const linked = found.replay ? el("a", { href: found.replay }, measure) : found.measure ? measure : "";
  return el("td", null, state, el("div", { class: "muted" }, linked));
}

/** Whether parameters are too many for a column each, as in batches of several scenarios. */
const MANY = data.parameters.length > 8;

/** Values of a run below its name, where parameters have no columns. */
function values(row) {
  const given = data.parameters.map((name, i) => [name, row.parameters[i]]).filter(([, value]) => (value ?? "") !== "");
  const text = given.map(([name, value]) => `${name}=${short(value)}`).join(", ");
  return MANY && text ? el("div", { class: "muted" }, text) : null;
}

function table() {
  const body = el("tbody"),
    told = el("span", { class: "muted", "aria-live": "polite" });
  let count = PAGE;
  const more = el("button", { click: () => ((count += 5 * PAGE), fill()) }, "Show more");
  const line = row =>
    el(
      "tr",
      null,
      el("td", { class: "name" }, row.name, row.fate ? el("div", { class: "muted" }, row.fate) : null, values(row)),
      ...row.cells.map(cell),
      ...(MANY ? [] : row.parameters).map(value => el("td", { class: "number" }, String(short(value)))),
    );
  const kept = row =>
    row.name.toLowerCase().includes(filter.words) &&
    (filter.kind === "" || (filter.kind === "changed" ? changes(row.cells) : row.fate === filter.kind));
  function fill() {
    const found = data.rows.filter(kept);
    body.replaceChildren(...found.slice(0, count).map(line));
    more.hidden = found.length <= count;
    told.textContent = `${Math.min(count, found.length)} of ${many(found.length, "run")}`;
  }
  const search = el("input", {
    type: "search",
    "aria-label": "Find runs",
    placeholder: "find by name",
    input: () => ((filter.words = search.value.toLowerCase()), (count = PAGE), fill()),
  });
  const kinds = [["", "all"], ["changed", "any change"], ...ORDER.slice(0, 5).map(name => [name, name])];
  const select = el(
    "select",
    { "aria-label": "Change", change: () => ((filter.kind = select.value), (count = PAGE), fill()) },
    ...kinds.map(([value, text]) => el("option", { value }, text)),
  );
  fill();
  const head = ([text, kind]) => el("th", { scope: "col", class: kind }, ...breakable(text));
  const parameters = (MANY ? [] : data.parameters).map(name => [name, "number"]);
  const heads = [["run"], ...data.versions.map(({ title }) => [title]), ...parameters];
  return el(
    "section",
    { class: "panel runs" },
    el("h2", null, "Runs"),
    el("div", { class: "choices" }, search, el("label", null, "Change", select), told),
    wideTable("Runs by version", heads.map(head), body),
    more,
  );
}

document.body.append(el("main", { id: "page" }, el("h1", null, `History of ${data.title}`), versions(), table()));
