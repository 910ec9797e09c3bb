// The page of all parts.

document.body.append(
  el(
    "main",
    { id: "page" },
    ...[
      el("h1", null, `${data.scenario}: how ${data.sut} fails`),
      el("section", { class: "panel headline" }, ...data.headline.map(text => el("p", null, text))),
      often(),
      against(),
      regions(),
      slices(),
      examples(),
      drivers(),
      method(),
    ].filter(Boolean),
  ),
);
