// What pages of generation share: counts, links, buttons that play, tables.

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
