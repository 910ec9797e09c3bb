// Parameter space: recorded, tried and generated, two parameters at a time.

function space() {
  if (!done.length) return null;
  const targets = [...new Map(done.map(search => [search.target, search])).values()];
  const first = targets.find(each => each.cases.length && each.parameters.length > 1) ?? targets[0];
  const select = (title, options) => {
    const chosen = el("select", { "aria-label": title }, ...options);
    return [el("label", null, title, chosen), chosen];
  };
  const [forTarget, target] = select(
    "Class",
    targets.map(each => el("option", { value: each.target, selected: each === first }, each.title)),
  );
  const [forX, x] = select("Across", []),
    [forY, y] = select("Up", []);
  const canvas = el("canvas", { role: "img", click: open, mousemove: point }),
    told = el("p", { class: "muted", "aria-live": "polite" });
  const roundColour = round => colour(round === 1 ? "bad" : "second");
  const ring = el("span", null, "");
  let places = [];

  function choose() {
    const { parameters } = targets.find(each => each.target === target.value);
    [
      [x, 0],
      [y, 1],
    ].forEach(([which, first]) =>
      which.replaceChildren(...parameters.map((each, i) => el("option", { value: i, selected: i === first }, each.name))),
    );
    draw();
  }

  function draw() {
    const searches = done.filter(search => search.target === target.value),
      [{ parameters, real, prior }] = searches;
    const { ctx, width, height } = fitted(canvas),
      [u, v] = [Number(x.value), Number(y.value)],
      xs = [62, width - 10],
      ys = [height - 40, 8];
    const range = i => {
      const { low, high } = parameters[i],
        room = (high - low) * 0.03;
      return [low - room, high + room];
    };
    const alone = parameters.length === 1, // then each kind of point has a row
      few = sum(searches.map(search => search.tried.length)) < 60,
      us = range(u),
      vs = alone ? [0, 4] : range(v),
      at = (value, [from, to], [low, high]) => from + ((value - low) / (high - low)) * (to - from);
    const dot = (theta, row, shape) => {
      const place = [at(theta[u], xs, us), at(alone ? row : theta[v], ys, vs)];
      ctx.beginPath();
      shape(...place);
      return place;
    };
    ctx.clearRect(0, 0, width, height);
    axes(ctx, xs, ys, us, vs, height, { across: parameters[u].name, up: alone ? "" : parameters[v].name });
    forY.style.display = alone ? "none" : "";
    if (alone) {
      ctx.clearRect(0, 0, xs[0] - 1, height);
      ctx.font = "11px system-ui, sans-serif";
      ctx.textAlign = "right";
      [prior.manoeuvres ? "recorded" : "stated", "runs", "cases"].forEach((text, i) =>
        ctx.fillText(text, xs[0] - 4, at(i + 1, ys, vs) + 4),
      );
    }
    ctx.fillStyle = colour("accent");
    ctx.globalAlpha = few ? 0.8 : 0.3;
    for (const search of searches)
      for (const theta of search.tried) {
        dot(theta, 2, (a, b) => ctx.arc(a, b, few ? 3 : 1.8, 0, 7));
        ctx.fill();
      }
    ctx.globalAlpha = 0.8;
    ctx.strokeStyle = colour("muted");
    for (const theta of real) {
      dot(theta, 1, (a, b) => ctx.arc(a, b, 3, 0, 7));
      ctx.stroke();
    }
    ctx.globalAlpha = 1;
    places = searches.flatMap(search =>
      search.cases.map(each => {
        ctx.fillStyle = roundColour(search.round);
        const [a, b] = dot(
          parameters.map(({ name }) => each.theta[name]),
          3,
          (p, q) => ctx.rect(p - 4.5, q - 4.5, 9, 9),
        );
        ctx.fill();
        return { each, round: search.round, a, b };
      }),
    );
    ring.textContent = prior.manoeuvres ? "recorded" : "stated";
    const words =
      `${alone ? "" : `${parameters[v].name} over `}${parameters[u].name}: ` +
      `${prior.manoeuvres ? many(real.length, "recorded manoeuvre") : `${many(real.length, "draw")} of what is stated`}, ` +
      `${many(sum(searches.map(search => search.tried.length)), "run")} of the search, ${many(places.length, "edge case")}`;
    canvas.setAttribute("aria-label", words);
    told.textContent = `${words}. Point at an edge case to see which it is, click to play it; the tables below list them all.`;
  }

  function near(event) {
    const { left, top } = canvas.getBoundingClientRect(),
      away = ({ a, b }) => Math.hypot(a - event.clientX + left, b - event.clientY + top);
    const best = places.reduce((p, q) => (p && away(p) <= away(q) ? p : q), null);
    return best && away(best) < 14 ? best : null;
  }

  function point(event) {
    const found = near(event);
    if (found)
      told.textContent =
        `${found.each.name}, round ${found.round}: ${verdict(found.each)[1]}, ` +
        `log-likelihood ${short(found.each.likelihood)}`;
  }

  function open(event) {
    const found = near(event);
    if (found?.each.play) location.href = link(found.each.play);
  }

  target.addEventListener("change", choose);
  for (const which of [x, y]) which.addEventListener("change", draw);
  redraws.push(draw);
  const key = [
    el("li", null, el("i", { class: "ring" }), ring),
    el("li", null, el("i", { style: "background:var(--accent)" }), "runs of the search"),
    ...rounds.map((_, i) =>
      el(
        "li",
        null,
        el("i", { class: "square", style: `background:var(--${i ? "second" : "bad"})` }),
        `edge cases, round ${i + 1}`,
      ),
    ),
  ];
  const section = el(
    "section",
    { class: "panel space" },
    el("h2", null, "Parameter space"),
    el("div", { class: "choices" }, forTarget, forX, forY),
    canvas,
    el("ul", { class: "legend" }, ...key),
    told,
  );
  queueMicrotask(choose);
  return section;
}
