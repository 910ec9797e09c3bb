// Rows of a folder with a box for questions, a link from each to its exploration, and the folder's own page.

const data = JSON.parse(document.getElementById("data").textContent);
const question = el("input", {
  type: "search",
  "aria-label": "Question to the rows",
  placeholder: "min_ttc < 2 and state = 'failed'",
  keydown: event => event.key === "Enter" && question.form.requestSubmit(),
});
const answered = el("p", { class: "muted", role: "status" });
const body = el("tbody");
const heads = el("tr");
const table = el("table", { class: "cards" }, el("thead", null, heads), body);

function fill({ columns, rows, count, noun, hint }) {
  heads.replaceChildren(...["", ...columns].map(name => el("th", { scope: "col" }, ...breakable(name))));
  body.replaceChildren(
    ...rows.map(([row, ...cells]) =>
      el(
        "tr",
        null,
        el("td", null, el("a", { href: `explore?row=${row}`, "aria-label": `Explore ${cells[0]}` }, "explore")),
        ...cells.map(cell => {
          const state = ["passed", "failed", "inconclusive", "error"].includes(cell);
          return el("td", null, state ? el("span", { class: `badge ${cell}` }, cell) : cell);
        }),
      ),
    ),
  );
  [...body.rows].forEach(row => nameCells(row, ["", ...columns]));
  const fewer = count > rows.length ? `, the first ${rows.length} are shown` : "";
  answered.textContent = `${count} ${noun}${count === 1 ? "" : "s"}${fewer}${hint && `: ${hint}`}`;
}

async function answer(event) {
  event.preventDefault();
  try {
    const found = await fetch("rows", {
      method: "POST",
      headers: { "Content-Type": "application/json" },
      body: JSON.stringify({ where: question.value }),
    });
    const said = await found.json();
    if (found.ok) fill(said);
    else answered.textContent = said.error;
  } catch {
    answered.textContent = "the command has ended: start it again";
  }
}

const columnsOf = el(
  "details",
  null,
  el("summary", { class: "muted" }, "Columns"),
  el("p", { class: "muted" }, data.names.join(", ")),
);
document.body.append(
  el(
    "main",
    { id: "page" },
    el("h1", null, data.title),
    el("form", { class: "panel asked", role: "search", submit: answer }, question, el("button", null, "Ask"), answered),
    el("section", { class: "panel", "aria-label": "Rows" }, columnsOf, wide("Rows", table)),
    ...data.pages.map((address, i) =>
      el(
        "details",
        { open: i === 0 },
        el("summary", null, address.split("/").at(-1)),
        el("iframe", { class: "framed", src: address, title: address.split("/").at(-1), loading: "lazy" }),
      ),
    ),
  ),
);
fill(data);
