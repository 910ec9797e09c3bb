// The page of a batch, made of all parts.

document.body.append(
  el(
    "main",
    { id: "page" },
    ...[
      el("h1", null, data.title),
      verdicts(),
      worst(),
      history(),
      evidence(),
      filters(),
      groups(),
      scatter(),
      distributions(),
      table(),
    ].filter(Boolean),
  ),
);
new ResizeObserver(redraw).observe(document.getElementById("page"));
matchMedia("(prefers-color-scheme: dark)").addEventListener("change", redraw);
refresh();
