// The edge cases of each search, with their runs.

function generated() {
  const failed = data.searches.filter(search => search.error);
  const refused = [
    ...data.refused.map(({ title, reason }) => [title, reason]),
    ...failed.map(search => [`${search.title}, round ${search.round}`, search.error]),
  ];
  const why = refused.length
    ? el(
        "details",
        { class: "group", open: !done.length },
        el("summary", null, el("h3", null, `Not searched: ${many(refused.length, "class or scenario", "classes or scenarios")}`)),
        el("dl", null, ...refused.flatMap(([title, reason]) => [el("dt", null, title), el("dd", null, reason)])),
      )
    : null;
  return el(
    "section",
    { class: "panel" },
    el("h2", null, "Edge cases generated"),
    el(
      "p",
      { class: "muted" },
      "Log-likelihood: how likely recorded traffic, or what is stated in its place, makes the parameters; higher is more " +
        "plausible. R_risk: share of time in which RSS distances are violated. A collision that a careful driver (r157-cc or " +
        "fsm) avoids is one that the system should have avoided.",
    ),
    ...done.map(search => searched(search)),
    why,
  );
}

function searched(search) {
  const columns = [
    ["replay", null],
    ["verdict", null],
    ["careful driver", null],
    ["log-likelihood", "number"],
    ["R_risk", "number"],
    ["recognised in the run", null],
    ["files", null],
    ["parameters", null],
  ];
  const told =
    `${many(search.calls, "run")}${search.failed_runs ? ` (${search.failed_runs} with errors)` : ""}, ` +
    `${many(search.collisions, "collision")}, ${search.new} new and unlike each other; ` +
    `density of ${priorOf(search.prior)}`;
  return el(
    "details",
    { class: "group", open: search.cases.length > 0 && search === done[0] },
    el(
      "summary",
      null,
      el("span", { class: "count" }, String(search.cases.length)),
      el("h3", null, search.title),
      badge("plain", `round ${search.round}`),
      el("span", { class: "muted" }, told),
    ),
    regionsOf(search),
    search.cases.length
      ? table(
          `${search.title}, round ${search.round}`,
          columns,
          search.cases.map(each => edge(each)),
        )
      : el("p", { class: "muted" }, search.calls > search.failed_runs ? "No run was critical." : "No run succeeded."),
    search.run_error
      ? el("p", null, badge("error", `${search.failed_runs} with errors or inconclusive`), ` Mostly: ${search.run_error}`)
      : null,
    el(
      "p",
      { class: "muted" },
      `Scenario ${search.scenario}; kept as they are: ${
        Object.entries(search.pinned)
          .map(([name, value]) => `${name} ${value}`)
          .join(", ") || "no parameters"
      }.`,
    ),
  );
}

// Regions of failure of a search, each with the replay of its likeliest edge case.
function regionsOf(search) {
  if (!search.regions.length) return null;
  const columns = [
    ["region of failure", null],
    ["precision, recall", "number"],
    ["failing draws", "number"],
    ["probability", "number"],
    ["impact m/s", "number"],
    ["edge cases", "number"],
    ["replay", null],
  ];
  const share = value => (value === null ? "–" : value.toFixed(2));
  const chance = value => `${(100 * value).toPrecision(2)} %`;
  const row = each => {
    const likeliest = search.cases.find(one => one.files.scenario === each.cases[0]);
    return el(
      "tr",
      null,
      el("td", null, each.rule),
      el("td", { class: "number" }, `${share(each.precision)}, ${share(each.recall)}`),
      el("td", { class: "number" }, `${each.drawn} of ${each.draws}`),
      el("td", { class: "number" }, each.draws ? `${chance(each.low)} to ${chance(each.high)}` : "–"),
      number(each.severity, 1),
      el("td", { class: "number" }, String(each.cases.length)),
      el("td", null, likeliest ? play(likeliest.play, likeliest.name) : "–"),
    );
  };
  return table(`Regions of failure, ${search.title}, round ${search.round}`, columns, search.regions.map(row));
}

function edge(each) {
  const careful = each.avoidable
    ? badge("avoidable", `avoided by ${each.survivors.join(", ")}`)
    : el("span", { class: "muted" }, CAREFUL[each.careful]);
  const seen = each.recognised.length
    ? each.recognised.map(({ title, file }, i) => el("span", null, i ? ", " : "", el("a", { href: link(file) }, title)))
    : ["–"];
  const theta = Object.entries(each.theta)
    .map(([name, value]) => `${name} ${short(value)}`)
    .join(", ");
  return el(
    "tr",
    null,
    el("td", null, play(each.play, each.name)),
    el("td", null, badge(...verdict(each))),
    el("td", null, careful),
    number(each.likelihood, 2),
    number(each.risk, 2),
    el("td", null, ...seen),
    files(each.files, each.name),
    el("td", { class: "theta muted" }, theta),
  );
}
