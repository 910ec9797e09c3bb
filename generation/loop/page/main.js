// The user's scenarios, what is not as it should be, and the page made of all parts.

function own() {
  if (!data.scenarios.length) return null;
  const columns = [
    ["replay", null],
    ["scenario", null],
    ["verdict", null],
    ["why", null],
    ["end (s)", "number"],
    ["least TTC (s)", "number"],
    ["least distance (m)", "number"],
  ];
  const rows = data.scenarios.map(run =>
    el(
      "tr",
      null,
      el("td", null, play(run.play, run.name)),
      el("td", null, run.name),
      el("td", null, badge(run.state, run.state)),
      el("td", { class: "muted" }, run.message || (run.status === "timeout" ? "no stop trigger until the time limit" : "–")),
      number(run.end, 2),
      number(run.measures.min_ttc, 2),
      number(run.measures.min_distance, 2),
    ),
  );
  const sampled = Object.entries(data.sampled).map(
    ([name, size]) => `${name}: ${data.scenarios.filter(run => run.file === name).length} of ${many(size, "parameter set")}`,
  );
  const told = sampled.length
    ? el(
        "details",
        null,
        el(
          "summary",
          { class: "muted" },
          `Of ${many(sampled.length, "variation file")} some parameter sets were drawn (--sample); the others were not run`,
        ),
        el("ul", { class: "muted" }, ...sampled.map(each => el("li", null, each))),
      )
    : null;
  return el(
    "section",
    { class: "panel" },
    el("h2", null, "Your scenarios"),
    ...[told].filter(Boolean),
    table("Your scenarios", columns, rows),
  );
}

function problems() {
  const unread = Object.entries(data.unread).map(([name, error]) => `${name}: ${error}`),
    listed = [...unread, ...data.errors, ...data.checked.problems];
  if (!listed.length) return null;
  return el(
    "section",
    { class: "panel" },
    el("h2", null, "Problems"),
    el("ul", { class: "problems" }, ...[...alike(listed)].map(([message, places]) => problem(message, places))),
  );
}

/** Places, as file:line, by message: a file that is copied into every folder says the same in each of them. */
function alike(problems) {
  const found = new Map();
  for (const each of problems) {
    const [, place, message] = each.match(/^(.*?:\d+): (.*)$/s) ?? [null, "", each];
    found.set(message, [...(found.get(message) ?? []), place]);
  }
  return found;
}

function problem(message, [first, ...others]) {
  const more = others.length
    ? el(
        "details",
        null,
        el("summary", null, `and in ${many(others.length, "other place")}`),
        el("ul", null, ...others.map(place => el("li", null, place))),
      )
    : null;
  return el("li", null, `${first ? `${first}: ` : ""}${message} `, ...[more].filter(Boolean));
}

document.body.append(
  el(
    "main",
    { id: "page" },
    ...[
      el("h1", null, `${data.title}: ${title}`),
      avoided(),
      flow(),
      against(),
      problems(),
      space(),
      generated(),
      recognised(),
      own(),
    ].filter(Boolean),
  ),
);
const redraw = () => redraws.forEach(draw => draw());
new ResizeObserver(redraw).observe(document.getElementById("page"));
matchMedia("(prefers-color-scheme: dark)").addEventListener("change", redraw);
