// What the loop is for: collisions that a careful driver would have avoided, as they happened.

function avoided() {
  const titled = done.flatMap(search => search.cases.map(each => ({ ...each, title: search.title }))),
    found = titled.filter(each => each.avoidable);
  const shown = found.filter(each => each.preview),
    collisions = cases.filter(each => each.verdict === "collision").length,
    others = collisions > found.length ? "; r157-cc or fsm survives each of them" : "";
  const told = found.length
    ? `${many(found.length, "collision")} that a careful driver would have avoided`
    : collisions
      ? `${many(collisions, "collision")}, of which the careful driver of UN R157 avoids none`
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
      `System under test: ${data.settings.sut}. The careful driver is the competent and careful human of UN R157. ` +
        (collisions ? `Of ${many(collisions, "collision")} written as edge cases it avoids ${found.length}${others}.` : "") +
        (shown.length ? " Click one to see it whole." : ""),
    ),
    previews.length ? playing(previews) : null,
    el("ul", { class: "previews" }, ...cards),
    rest > 0 ? el("p", { class: "muted" }, `${rest} more are in the tables below.`) : null,
  );
}
