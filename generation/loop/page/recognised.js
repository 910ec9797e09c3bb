// What was recognised in the recordings, by class.

function recognised() {
  if (!data.recordings) return null;
  const groups = STATES.flatMap(state => data.classes.filter(each => each.state === state).map(group));
  const none = STATES.filter(state => !scenarios(state)).map(state => el("p", { class: "muted" }, `No ${state} scenarios.`));
  return el(
    "section",
    { class: "panel" },
    el("h2", null, "Recognised in the recordings"),
    el(
      "p",
      { class: "muted" },
      "Known: one of the classes that the model has learnt. Unknown: unlike all of them. Discovered: unknown, but " +
        "frequent and alike, so that the model has taken it for a class of its own, which has no name yet.",
    ),
    ...groups,
    ...none,
    el("p", null, "All of them: ", el("a", { href: link(data.catalogue) }, data.catalogue)),
  );
}

function group(each) {
  const votes = each.state === "known" ? "confidence" : "votes for the nearest known class";
  const sure = each.rows.map(row => row.confidence).filter(value => value !== null),
    range = sure.length ? `${votes} ${short(least(sure))} to ${short(greatest(sure))}` : "";
  const shown = each.rows.length < each.count ? `${each.rows.length} shown` : "";
  const columns = [
    ["replay", null],
    [votes, null],
    ["vehicle", null],
    ["recording", null],
    ["time (s)", "number"],
    ["participants", "number"],
    ["least TTC (s)", "number"],
    ["least distance (m)", "number"],
    [each.state === "known" ? "rules say" : "nearest known class", null],
    ["files", null],
  ];
  return el(
    "details",
    { class: "group", open: each.state === "discovered" },
    el(
      "summary",
      null,
      el("span", { class: "count" }, String(each.count)),
      el("h3", null, each.title),
      badge(each.state, each.state),
      el("span", { class: "muted" }, [range, shown].filter(Boolean).join(", ")),
    ),
    table(
      each.title,
      columns,
      each.rows.map(row => recorded(row, each.state)),
    ),
  );
}

function recorded(row, state) {
  const sure =
    row.confidence === null
      ? "–"
      : el("span", { class: "sure" }, el("i", { style: `--share:${100 * row.confidence}%` }), row.confidence.toFixed(2));
  const says = state === "known" ? row.rule_class : row.model_class;
  return el(
    "tr",
    null,
    el("td", null, play(row.play, row.name)),
    el("td", null, sure),
    el("td", null, row.vehicle),
    el("td", null, row.recording),
    number(row.time, 2),
    number(row.participants),
    number(row.measures.min_ttc, 2),
    number(row.measures.min_distance, 2),
    el("td", { class: "muted" }, says ?? "–"),
    files(row.files, row.name),
  );
}
