// What the loop is for: collisions that a careful driver would have avoided, as they happened.

function avoided() {
  const titled = done.flatMap(search => search.cases.map(each => ({ ...each, title: search.title }))),
    found = titled.filter(each => each.avoidable);
  const shown = found.filter(each => each.preview).sort((a, b) => a.turn - b.turn),
    collisions = cases.filter(each => each.verdict === "collision").length;
  const avoids = name => `${name} avoids ${found.filter(each => each.survivors.includes(name)).length}`;
  const told = found.length
    ? `${many(found.length, "collision")} that a careful driver would have avoided`
    : collisions
      ? `${many(collisions, "collision")}, of which no careful driver is known to avoid one`
      : total(done, "calls") > total(done, "failed_runs")
        ? "No collision that a careful driver would have avoided"
        : done.length
          ? "No run of the search succeeded"
          : "Nothing was searched";
  const rest = found.length - shown.length;
  return el(
    "section",
    { class: "panel avoided" },
    el("h2", null, told),
    el(
      "p",
      { class: "muted" },
      `System under test: ${data.settings.sut}. Careful drivers are r157-cc, the competent and careful human of UN R157, and ` +
        "fsm, the Fuzzy Safety Model of the JRC. " +
        (collisions
          ? `Of ${many(collisions, "collision")} written as edge cases ${avoids("r157-cc")} and ${avoids("fsm")}.`
          : "") +
        (shown.length ? " Click one to see it whole." : ""),
    ),
    ...shownFilms(shown),
    rest > 0 ? el("p", { class: "muted" }, `${rest} more are in the tables below.`) : null,
  );
}
