// What pages of generation share: counts, links, buttons that play, tables.

const redraws = [];
const many = (count, one, several = `${one}s`) => `${count.toLocaleString("en")} ${count === 1 ? one : several}`;
const link = path => {
  const [file, hash] = path.split("#");
  return file.split("/").map(encodeURIComponent).join("/") + (hash ? `#${hash}` : "");
};

const badge = (kind, text) => el("span", { class: `badge ${kind}` }, text);
const play = (path, name) =>
  path
    ? el("a", { class: "play", href: link(path), "aria-label": `Play ${name}` }, "▶ Play")
    : el("span", { class: "muted" }, "no replay");
const FILES = { scenario: ".xosc", manoeuvre: "manoeuvre", road: ".xodr", tags: "tags" };
const files = (each, name) =>
  el(
    "td",
    { class: "files" },
    ...Object.entries(each).map(([kind, path]) => el("a", { href: link(path), "aria-label": `${kind} of ${name}` }, FILES[kind])),
  );

/** A table in a region of its own that scrolls; columns are [title, class]. */
function table(label, columns, rows) {
  const heads = columns.map(([title, kind]) => el("th", { scope: "col", class: kind }, ...breakable(title)));
  return wideTable(label, heads, el("tbody", null, ...rows));
}
/** A cell with a number, with so many decimals where these are given. */
const number = (value, places) =>
  el("td", { class: "number" }, typeof value === "number" && places !== undefined ? value.toFixed(places) : String(short(value)));

/** Moving pictures of runs, each a link to its replay: a button that pauses them, and their list; nothing where there is none. */
function shownFilms(films) {
  if (!films.length) return [];
  const previews = films.map(each => new Preview(each.preview, `${each.title}: ${each.preview.told}`));
  const cards = films.map((each, i) =>
    el(
      "li",
      null,
      el(
        "a",
        { href: link(each.play), "aria-label": `Play ${each.title}: ${each.preview.told}` },
        previews[i].canvas,
        el("strong", null, each.title),
        el("span", null, each.preview.told),
      ),
    ),
  );
  for (const preview of previews) redraws.push(() => preview.draw(preview.last));
  return [playing(previews), el("ul", { class: "previews" }, ...cards)];
}
