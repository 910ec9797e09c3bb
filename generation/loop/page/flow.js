// How the loop went: its steps with their numbers, its settings, reports of its runs.

function flow() {
  const step = (title, count, told) =>
    el("li", null, el("h3", null, title), el("strong", null, count.toLocaleString("en")), el("p", null, told));
  const unread = Object.keys(data.unread).length,
    runs = state => data.scenarios.filter(run => run.state === state).length,
    found = sum(data.classes.map(each => each.count)),
    steps = [];
  if (data.recordings) {
    steps.push(step("Recordings", data.recordings, unread ? `${unread} could not be read` : "all read"));
    steps.push(step("Scenarios recognised", found, STATES.map(state => `${scenarios(state)} ${state}`).join(", ")));
  }
  if (data.scenarios.length)
    steps.push(
      step(
        "Runs of your scenarios",
        data.scenarios.length,
        `${runs("failed")} failed, ${runs("error")} with errors or inconclusive`,
      ),
    );
  steps.push(
    step(
      "Runs searched",
      total(done, "calls"),
      `${many(new Set(done.map(search => search.target)).size, "logical scenario")}, ${many(last, "round")}` +
        (total(done, "failed_runs") ? `, ${many(total(done, "failed_runs"), "run")} with errors or inconclusive` : ""),
    ),
  );
  steps.push(step("Collisions", total(done, "collisions"), `${total(done, "new")} of them unlike each other`));
  const collisions = cases.filter(each => each.verdict === "collision").length,
    problems = data.checked.problems.length;
  steps.push(
    step(
      "Edge cases written",
      cases.length,
      `${collisions} collisions; ${many(data.checked.files, "file")} checked, ` +
        (problems ? many(problems, "problem") : "all valid"),
    ),
  );
  steps.push(step("A careful driver avoids", cases.filter(each => each.avoidable).length, "of these collisions"));
  const back = rounds
    .slice(1)
    .map((searches, i) =>
      el(
        "p",
        { class: "loop" },
        `Round ${i + 2} started from ${many(total(rounds[i], "failed"), "failure")} of round ${i + 1} ` +
          `(${many(total(rounds[i], "distinct"), "collision")} unlike each other among them) and found ` +
          `${many(total(searches, "new"), "collision")} unlike all of those, with as many runs.`,
      ),
    );
  return el(
    "section",
    { class: "panel" },
    el("h2", null, "The loop"),
    el(
      "p",
      { class: "muted" },
      `System under test: ${data.settings.sut}. ` +
        `${data.recordings ? "Recordings become scenarios, s" : "S"}cenarios become edge cases, ` +
        "and what it fails at is where the next round of search begins.",
    ),
    el("ol", { class: "flow" }, ...steps),
    ...back,
    settings(),
  );
}

function settings() {
  const told = Object.entries(data.settings).flatMap(([name, value]) => [el("dt", null, name), el("dd", null, value)]);
  const reports = data.reports.map(each => el("li", null, el("a", { href: link(each.file) }, REPORTS[each.of](each))));
  return el(
    "details",
    null,
    el("summary", { class: "muted" }, "settings and reports of all runs"),
    el("dl", null, ...told),
    el("ul", null, ...reports),
  );
}
