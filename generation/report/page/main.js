// The page of all parts: what was found and how it looks, then what changed, then statistics.

function headline() {
  const [found, ...others] = data.headline;
  const films = shownFilms(data.films);
  return el(
    "section",
    { class: "panel headline" },
    el("p", null, found),
    films.length
      ? el("p", { class: "muted" }, "Failures told apart, each shortly before the conflict. Click one to see it whole.")
      : others[0],
    ...films,
  );
}

const statistics = () =>
  panel("How sure this is", el("ul", null, ...data.headline.slice(1).map(text => el("li", null, text))));

document.body.append(
  el(
    "main",
    { id: "page" },
    ...[
      el("h1", null, `${data.scenario}: how ${data.sut} fails`),
      headline(),
      against(),
      statistics(),
      often(),
      regions(),
      slices(),
      examples(),
      drivers(),
      assurance(),
      method(),
    ].filter(Boolean),
  ),
);
const redraw = () => redraws.forEach(draw => draw());
new ResizeObserver(redraw).observe(document.getElementById("page"));
matchMedia("(prefers-color-scheme: dark)").addEventListener("change", redraw);
