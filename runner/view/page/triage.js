// Files of a folder by group and cause, a row a file.

const data = JSON.parse(document.getElementById("data").textContent);
const BADGES = { fine: "passed", "plays with repairs": "inconclusive", "tests nothing": "open", refused: "failed" };
const many = (count, one) => `${count.toLocaleString("en")} ${one}${count === 1 ? "" : "s"}`;
const told = file => file.message + (file.repairs > 1 ? ` (and ${many(file.repairs - 1, "more repair")})` : "");
const place = file => (file.line === null ? file.path : `${file.path}:${file.line}`);

function table(files, label) {
  const heads = ["file", "kind", "first fault or repair", "errors", "warnings"];
  const rows = files.map(file =>
    el(
      "tr",
      null,
      el("td", { class: "name" }, place(file)),
      el("td", null, file.kind),
      el("td", { class: "why muted" }, told(file)),
      el("td", { class: "number" }, String(file.errors || "–")),
      el("td", { class: "number" }, String(file.warnings || "–")),
    ),
  );
  const cells = heads.map((text, i) => el("th", { scope: "col", class: i > 2 && "number" }, text));
  return wideTable(label, cells, el("tbody", null, ...rows));
}

/** Files of one cause; a list without a cause stands open. */
function cause({ cause: text, files }) {
  if (!text) return table(files, "Files");
  return el(
    "details",
    { class: "group", open: files.length < 20 },
    el("summary", null, el("span", { class: "count" }, many(files.length, "file")), text),
    table(files, text),
  );
}

function group({ name, meaning, causes }) {
  const count = causes.reduce((sum, each) => sum + each.files.length, 0);
  if (!count) return null;
  return el(
    "section",
    { class: "panel" },
    el("h2", null, el("span", { class: `badge ${BADGES[name]}` }, name), ` ${many(count, "file")}`),
    el("p", { class: "muted" }, `A file that ${name === "fine" ? "is " : ""}${meaning}.`),
    ...causes.map(cause),
  );
}

document.body.append(
  el(
    "main",
    { id: "page" },
    el("h1", null, "Triage"),
    el("p", { class: "verdict" }, data.summary),
    ...data.groups.toReversed().map(group).filter(Boolean),
  ),
);
