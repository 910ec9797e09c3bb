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
  const previews = shown.map(each => new Preview(each.preview, `${each.title}: ${each.preview.told}`));
  const cards = shown.map((each, i) =>
    el(
      "li",
      null,
      el(
        "a",
        { href: link(each.play), "aria-label": `Play ${each.name}: ${each.preview.told}` },
        previews[i].canvas,
        el("strong", null, each.title),
        el("span", null, each.preview.told),
      ),
    ),
  );
  for (const preview of previews) redraws.push(() => preview.draw(preview.last));
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
    previews.length ? playing(previews) : null,
    el("ul", { class: "previews" }, ...cards),
    rest > 0 ? el("p", { class: "muted" }, `${rest} more are in the tables below.`) : null,
  );
}
