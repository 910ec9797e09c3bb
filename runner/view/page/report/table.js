// All runs as a table that sorts.

const PAGE = 200; // rows that are shown at first

function table() {
  const order = { by: null, down: false };
  let count = PAGE,
    runs = [];
  const tabled = columns.filter(column => !column.parameter || inColumns.length);
  const sortable = [
    { title: "run", of: run => run.name },
    { title: "verdict", of: run => STATES.indexOf(run.state) },
    ...tabled,
  ];
  const heads = sortable.map(column => {
    const head = el(
      "th",
      { scope: "col", class: columns.includes(column) ? "number" : null },
      el("button", { click: () => sort(column) }, ...breakable(column.title)),
    );
    return { column, head };
  });
  const body = el("tbody"),
    more = el(
      "button",
      {
        click: () => {
          count += PAGE * 5;
          fill();
        },
      },
      "Show more",
    ),
    told = el("p", { class: "muted" });

  function sort(column) {
    order.down = order.by === column && !order.down;
    order.by = column;
    for (const each of heads)
      each.head.setAttribute("aria-sort", each.column === column ? (order.down ? "descending" : "ascending") : "none");
    fill();
  }

  function compare(a, b) {
    const [u, v] = [order.by.of(a), order.by.of(b)],
      sign = order.down ? -1 : 1;
    if (u === v) return 0;
    if (u === null || v === null) return u === null ? 1 : -1; // what is not defined comes last, either way
    return (
      sign *
      (typeof u === "number" && typeof v === "number" ? u - v : String(u).localeCompare(String(v), "en", { numeric: true }))
    );
  }

  function fill() {
    const found = [...runs].sort(order.by ? compare : bySeverity);
    body.replaceChildren(...found.slice(0, count).map(row));
    more.hidden = found.length <= count;
    told.textContent = found.length > count ? `${count} of ${found.length} runs` : "";
  }

  function row(run) {
    return el(
      "tr",
      null,
      el("td", { class: "name" }, named(run), values(run)),
      el("td", null, el("span", { class: `badge ${run.state}` }, run.state)),
      el("td", { class: "why muted" }, run.causes.length ? `${run.causes.join(", ")}: ` : null, reason(run)),
      ...tabled.map(column => el("td", { class: "number" }, shown(column, run))),
    );
  }

  listeners.push(found => {
    [runs, count] = [found, PAGE];
    fill();
  });
  return el(
    "section",
    { class: "panel runs" },
    el("h2", null, "Runs"),
    wideTable(
      "Table of runs",
      [
        ...heads.slice(0, 2).map(each => each.head),
        el("th", { scope: "col" }, "ended by"),
        ...heads.slice(2).map(each => each.head),
      ],
      body,
    ),
    told,
    more,
  );
}
