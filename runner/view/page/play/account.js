// What a run comes to: its name and verdict, a few sentences, and what it was given.

const given = run => ({ ...run.parameters, "system under test": run.sut, ...run.settings });

/** The letter of one of two runs. */
function sign(runs, index) {
  return runs.length > 1
    ? el("span", { class: `sign run${index}`, role: "img", "aria-label": `run ${"AB"[index]}` }, "AB"[index])
    : null;
}

/** Sentences; those about an instant lead there. */
function sentences(run, seek) {
  const parts = run.account.map(([text, time]) =>
    el("li", null, time === null ? text : el("button", { class: "plain", click: () => seek(time) }, text)),
  );
  return el("ol", { class: "account", "aria-label": "What happened" }, ...parts);
}

// remarks that are shown without being asked for
const FEW = 1;

function list(lines) {
  return lines.length ? el("ul", { class: "reasons muted" }, ...lines.map(line => el("li", null, line))) : null;
}

/** What a run has tested, in numbers: what is missing first. */
function evidence(rows) {
  if (!rows.length) return null;
  const missing = rows.filter(row => !row.enough);
  const line = ({ name, value, least, enough, meaning }) =>
    el(
      "tr",
      null,
      el("th", { scope: "row", title: meaning }, name.replaceAll("_", " ")),
      el("td", { class: "number" }, value),
      el("td", { class: "number muted" }, least),
      el("td", { class: enough ? "muted" : "lacking" }, enough ? "enough" : "missing"),
      el("td", { class: "muted" }, meaning),
    );
  const heads = [["evidence"], ["value", "number"], ["least", "number"], [""], ["counted"]];
  const body = el("tbody", null, ...[...missing, ...rows.filter(row => row.enough)].map(line));
  const told = `Evidence: ${rows.length - missing.length} of ${rows.length} enough`;
  return el(
    "details",
    { class: "evidence" },
    el("summary", { class: "muted" }, missing.length ? `${told}, missing: ${missing.map(row => row.name).join(", ")}` : told),
    wideTable("Evidence", heads.map(([text, kind]) => el("th", { scope: "col", class: kind ?? null }, text)), body),
  );
}

function headline(runs, i, seek) {
  const run = runs[i];
  return el(
    "header",
    { class: `run${i}` },
    el(
      "div",
      { class: "title" },
      sign(runs, i),
      el(runs.length > 1 ? "h2" : "h1", null, run.name),
      el("span", { class: `badge ${run.verdict}` }, run.verdict),
      el("span", { class: "muted" }, `${seconds(run.end)}, ended by ${ENDS[run.status]}`),
    ),
    sentences(run, seek),
    list(run.reasons),
    run.remarks.length > FEW
      ? el("details", null, el("summary", { class: "muted" }, `${run.remarks.length} remarks`), list(run.remarks))
      : list(run.remarks),
    evidence(run.evidence ?? []),
    el(
      "details",
      null,
      el("summary", { class: "muted" }, "Parameters and settings"),
      el("dl", null, ...Object.entries(given(run)).flatMap(([name, value]) => [el("dt", null, name), el("dd", null, value)])),
    ),
  );
}

// two runs ------------------------------------------------------------------------------------

const APART = 0.1; // m between two egos from which on they do not do the same
const SOON = 0.5; // s after which egos that are apart have done the same before

/** When the egos of two runs are apart for the first time; null where they never are. */
function parting([a, b]) {
  const [own, other] = [a, b].map(run => run.tracks.find(track => track.name === run.ego));
  if (!own || !other) return null;
  const last = Math.min(a.end, b.end);
  for (let time = 0; time <= last; time += Math.max(a.sample, b.sample)) {
    const [here, there] = [stateAt(own, time, a.sample), stateAt(other, time, b.sample)];
    if (!here !== !there || (here && Math.hypot(here.x - there.x, here.y - there.y) > APART)) return time;
  }
  return null;
}

/** What two runs were given differently, from when on their egos differ, and what came of it. */
function comparison(runs, plots, seek) {
  const [a, b] = runs.map(given);
  const names = [...new Set([...Object.keys(a), ...Object.keys(b)])].filter(name => a[name] !== b[name]);
  const differing = names.map(name => [name, [a, b].map(values => values[name] ?? "as declared")]);
  const verdicts = ["verdict", runs.map(run => `${run.verdict} at ${seconds(run.end)}`)];
  const extremes = plots.map(plot => [plot.label, plot.extremes.map(extreme => (extreme ? plot.told(extreme) : "–"))]);
  const head = el("tr", null, el("td"), ...runs.map((_, i) => el("th", { scope: "col" }, sign(runs, i))));
  const row = ([name, values]) =>
    el("tr", null, el("th", { scope: "row" }, name), ...values.map(value => el("td", null, value)));
  const body = (title, rows) =>
    el("tbody", null, el("tr", null, el("th", { colspan: 3, scope: "rowgroup", class: "group" }, title)), ...rows.map(row));
  return el(
    "section",
    { class: "panel differs", "aria-label": "What differs" },
    el("h2", null, "What differs"),
    parted(runs, seek),
    names.length ? null : el("p", { class: "muted" }, "Both were given the same parameters, system and settings."),
    el(
      "table",
      null,
      el("thead", null, head),
      names.length ? body("Given", differing) : null,
      body("Came of it", [verdicts, ...extremes]),
    ),
  );
}

/** From when on the egos differ, in words. */
function parted(runs, seek) {
  const apart = parting(runs);
  if (apart === null) return el("p", null, "Both egos drive the same way at the same time, within 0.1 m.");
  if (apart < SOON) return el("p", null, "The egos are apart from the beginning.");
  const text = `Both egos do the same until ${seconds(apart)}, within 0.1 m.`;
  return el("p", null, el("button", { class: "plain", click: () => seek(apart) }, text));
}
