// How many runs passed and failed, and what has changed since an earlier batch.

function verdicts() {
  const counts = STATES.map(state => data.runs.filter(run => run.state === state).length),
    [failed, broken, untested] = counts;
  const told = [
    failed ? `${failed} of ${many(data.runs.length, "run")} failed` : "No run failed",
    broken ? `${many(broken, "file")} could not be run` : null,
    untested ? `${many(untested, "run")} inconclusive` : null,
  ];
  return el(
    "section",
    { class: "panel" },
    el("h2", { class: "verdict" }, told.filter(Boolean).join(", ")),
    el(
      "div",
      { class: "share", role: "img", "aria-label": STATES.map((state, i) => `${counts[i]} ${state}`).join(", ") },
      ...STATES.map((state, i) =>
        el("i", { style: `width:${(100 * counts[i]) / Math.max(1, data.runs.length)}%;background:var(--${state})` }),
      ),
    ),
    legend(counts),
    el(
      "details",
      null,
      el("summary", { class: "muted" }, "Settings"),
      el("dl", null, ...Object.entries(data.settings).flatMap(([name, value]) => [el("dt", null, name), el("dd", null, value)])),
    ),
  );
}

function legend(counts) {
  return el(
    "ul",
    { class: "legend" },
    ...STATES.map((state, i) =>
      el("li", null, el("i", { class: state, style: `background:var(--${state})` }), `${counts[i]} ${state}`),
    ),
  );
}

// evidence ------------------------------------------------------------------------------------

/** What all runs have tested, in numbers: a row a kind, those that some runs lack first. */
function evidence() {
  const rows = data.evidence ?? [],
    work = (data.work ?? []).map(({ name, done, planned }) => `${name} ${done} of ${planned}`);
  if (!rows.length && !work.length) return null;
  const lacking = rows.filter(row => row.below),
    ordered = [...lacking, ...rows.filter(row => !row.below)];
  const told = lacking.length
    ? `Below the least value: ${lacking.map(row => `${row.name} (${many(row.below, "run")})`).join(", ")}`
    : `${many(rows.length, "kind")} of evidence, enough in all runs`;
  const inWords = (value, unit) => {
    if (unit === "yes") return value ? "yes" : "no";
    return unit === "share" ? `${short(100 * value)} %` : `${short(value)} ${unit}`;
  };
  const line = row =>
    el(
      "tr",
      null,
      el("th", { scope: "row" }, row.name.replaceAll("_", " ")),
      el("td", { class: "number" }, String(row.runs)),
      el("td", { class: "number" }, inWords(row.worst, row.unit)),
      el("td", { class: "number muted" }, inWords(row.least, row.unit)),
      el("td", { class: row.below ? "number lacking" : "number" }, String(row.below)),
      el("td", { class: "muted" }, row.meaning),
    );
  const numbers = ["runs", "least found", "least needed", "below"].map(text => [text, "number"]);
  const heads = [["evidence"], ...numbers, ["counted"]];
  return el(
    "section",
    { class: "panel", "aria-label": "Evidence" },
    el("h2", null, "Evidence"),
    work.length ? el("p", { class: "muted" }, `Planned and done: ${work.join(", ")}`) : null,
    el(
      "details",
      null,
      el("summary", { class: lacking.length ? "lacking" : "muted" }, told),
      wideTable(
        "Evidence of all runs",
        heads.map(([text, kind]) => el("th", { scope: "col", class: kind ?? null }, text)),
        el("tbody", null, ...ordered.map(line)),
      ),
    ),
  );
}

// severity ------------------------------------------------------------------------------------

const WORST = 5;
/** Values of a run's own parameters: a batch of several scenarios has those of all. */
const given = run =>
  data.parameters
    .filter(name => (run.parameters[name] ?? null) !== null)
    .map(name => `${name}=${short(run.parameters[name])}`)
    .join(", ");

/** Parameters with a column of their own: none where there are many, as in batches of several scenarios. */
const inColumns = data.parameters.length > 8 ? [] : data.parameters;

/** Values of a run below its name, where parameters have no columns. */
const values = run => (inColumns.length < data.parameters.length ? el("div", { class: "muted" }, given(run)) : null);

/** Runs in their order, but the first of each scenario and cause before its likes: five of one kind would hide the others. */
function unlike(runs) {
  const known = new Set(),
    kind = run => `${run.group} ${run.impact ?? cause(run)}`.replace(/-?\b\d+(\.\d+)?\b/g, "…");
  const first = runs.filter(run => known.size < known.add(kind(run)).size);
  return [...first, ...runs.filter(run => !first.includes(run))];
}

/** The hardest contacts, or the nearest misses where there is none. */
function worst() {
  const hit = data.runs.filter(run => typeof run.measures.impact_speed === "number" && run.state !== "passed"),
    near = data.runs.filter(run => run.state === "passed" && typeof run.measures.min_distance === "number");
  const runs = unlike((hit.length ? hit : near).sort(bySeverity)).slice(0, WORST);
  if (data.runs.length < 2 || !runs.length) return null;
  const names = hit.length ? ["impact_speed", "delta_v", "fatality_risk"] : ["min_distance", "min_ttc"],
    shownColumns = names.map(id => columns.find(column => column.id === id));
  const title = hit.length ? `Worst ${runs.length} of ${many(hit.length, "contact")}` : `Nearest ${runs.length} misses`;
  return el(
    "section",
    { class: "panel" },
    el("h2", null, title),
    wideTable(
      title,
      [
        el("th", { scope: "col" }, "run"),
        ...shownColumns.map(column => el("th", { scope: "col", class: "number" }, column.title)),
        hit.length ? el("th", { scope: "col" }, "contact") : null,
      ],
      el(
        "tbody",
        null,
        ...runs.map(run =>
          el(
            "tr",
            null,
            el("td", { class: "name" }, named(run), el("div", { class: "muted" }, given(run))),
            ...shownColumns.map(column => el("td", { class: "number" }, shown(column, run))),
            hit.length ? el("td", { class: "why muted" }, run.impact ?? reason(run)) : null,
          ),
        ),
      ),
    ),
    hit.length
      ? el("p", { class: "muted" },
          "Fatality risk by Joksch (1993) for occupants, by Rosén and Sander (2009) for pedestrians and riders.")
      : null,
  );
}

// history -------------------------------------------------------------------------------------

const SHOWN = 30; // runs that are listed at most for each kind of change

/** What has changed since an earlier batch; nothing where none was named. */
function history() {
  const { against } = data;
  if (!against) return null;
  const worse = run => run.state !== "passed";
  const began = run => run.before.state === "passed" || (run.state === "failed" && run.before.state !== "failed");
  const both = data.runs.filter(run => run.before),
    same = both.filter(run => !run.before.changed),
    kinds = [
      ["fails now, or does not pass now and passed before", same.filter(run => worse(run) && began(run))],
      ["of files that have changed since", both.filter(run => run.before.changed)],
      ["passes now, did not before", same.filter(run => !worse(run) && run.before.state !== "passed")],
      ["does not pass, as before", same.filter(run => worse(run) && !began(run))],
      ["is new", data.runs.filter(run => !run.before)],
    ];
  const earlier = against.report ? el("a", { href: against.report }, against.title) : against.title;
  return el(
    "section",
    { class: "panel", "aria-label": "History" },
    el("h2", null, "Since ", earlier),
    el("p", { class: "muted" }, `${many(both.length, "run")} in both batches, ${against.gone.length} only in the earlier one.`),
    ...kinds.filter(([, runs]) => runs.length).map(([title, runs], i) => change(title, runs, i === 0)),
    against.gone.length ? gone(against.gone) : null,
  );
}

function change(title, runs, open) {
  const least = columns.filter(({ id }) => ["min_ttc", "min_distance"].includes(id));
  const was = (run, column) => (run.before ? `${sized(column, column.before(run))} → ` : "") + shown(column, run);
  const numbers = [...inColumns, ...least.map(column => column.title)],
    head = [["run"], ["now"], ...numbers.map(title => [title, "number"])];
  const row = run =>
    el(
      "tr",
      null,
      el("td", { class: "name" }, named(run), ...both(run), values(run)),
      el("td", { class: "muted" }, reason(run)),
      ...inColumns.map(name => el("td", { class: "number" }, String(short(run.parameters[name])))),
      ...least.map(column => el("td", { class: "number" }, was(run, column))),
    );
  const heading = ([text, kind]) => el("th", { scope: "col", class: kind }, ...breakable(text));
  const body = el("tbody", null, ...runs.slice(0, SHOWN).map(row));
  const all = () => {
    body.append(...runs.slice(SHOWN).map(row));
    more.remove();
  };
  const more = runs.length > SHOWN ? el("button", { click: all }, `Show all ${runs.length}`) : null;
  return el(
    "details",
    { class: "group", open },
    el("summary", null, el("span", { class: "count" }, String(runs.length)), title),
    wideTable(title, head.map(heading), body),
    more,
  );
}

function gone(names) {
  return el(
    "details",
    { class: "group" },
    el("summary", null, el("span", { class: "count" }, String(names.length)), "only in the earlier batch"),
    el("ul", null, ...names.slice(0, SHOWN).map(name => el("li", null, name))),
  );
}

/** A link to the page that plays a run beside what it was before, where there is one. */
const both = run => (run.pair ? [" ", el("a", { href: address(run.pair) }, "before and after")] : []);

/** A run's name, with a link to its replay where there is one. */
const named = run => (run.replay ? el("a", { href: link(run) }, run.name) : run.name);
