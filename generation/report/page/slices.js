// Where the system fails: runs over two measures at a time, with the boundary between those that fail and the others.

const SIZE = { width: 420, height: 320, left: 52, right: 10, top: 10, bottom: 44 };
const NEAR = 0.5; // standard deviations of the other measures from the slice

function slices() {
  const { region } = data;
  if (region.reason) return panel("Where it fails", el("p", null, `No boundary is drawn: ${region.reason}.`));
  const percent = share => `${Math.round(100 * share)} %`;
  const weights = region.weights.map(([index, weight]) => `${data.measures[index].name} ${figure(weight)}`);
  const total = data.runs.total.toLocaleString("en"),
    shown = data.runs.fails.length;
  return panel(
    "Where it fails",
    el(
      "p",
      null,
      `A quadratic boundary over ${data.measures.length} measures (logistic regression) separates failures from other runs: ` +
        `balanced accuracy ${percent(region.accuracy)} ± ${figure(100 * region.spread)} % in five-fold cross-validation ` +
        `(chance 50 %), area under the curve ${region.area.toFixed(3)}.`,
    ),
    note(
      "Accuracy lost when a measure is shuffled: ",
      weights.join(", "),
      ". Runs were sought near failures: the boundary says where the system fails, not how often.",
    ),
    el("div", { class: "slices" }, ...region.slices.map(slice)),
    legend(),
    note(
      `${shown < data.runs.total ? `${shown} of ${total} runs, evenly chosen` : `All ${total} runs`}. ` +
        `Drawn are the measures that matter most; with these alone the accuracy is ${percent(region.alone)}. ` +
        "The line is the boundary where the third one has its median over the failures; " +
        "runs within half a standard deviation of that are drawn strongly, the others faintly.",
    ),
  );
}

function legend() {
  const item = (kind, text) => el("li", null, el("i", { class: kind }), text);
  const marks = data.counterexamples.map((each, i) => item(`mark mark-${i}`, each.names.map(name => WHICH[name]).join(", ")));
  return el(
    "ul",
    { class: "legend" },
    item("fails", "run with a collision"),
    item("passes", "run without"),
    item("line", "boundary"),
    ...marks,
  );
}

function slice({ across, up, held, boundary }) {
  const { width, height, left, right, top, bottom } = SIZE,
    [us, vs] = [data.measures[across].range, data.measures[up].range];
  const x = value => left + ((value - us[0]) / (us[1] - us[0])) * (width - left - right);
  const y = value => height - bottom - ((value - vs[0]) / (vs[1] - vs[0])) * (height - top - bottom);
  const others = data.region.drawn.filter(i => i !== across && i !== up);
  const near = values => others.every(i => Math.abs(values[i] - held[i]) <= NEAR * data.runs.spread[i]);
  const dots = data.runs.values.map((values, i) =>
    svg("circle", {
      cx: x(values[across]).toFixed(1),
      cy: y(values[up]).toFixed(1),
      r: 2.6,
      class: `${data.runs.fails[i] ? "fails" : "passes"}${near(values) ? "" : " far"}`,
    }),
  );
  const far = dots.filter(dot => dot.classList.contains("far")),
    close = dots.filter(dot => !dot.classList.contains("far"));
  const lines = boundary.map(points =>
    svg("polyline", { class: "boundary", points: points.map(([a, b]) => `${x(a).toFixed(1)},${y(b).toFixed(1)}`).join(" ") }),
  );
  const marks = data.counterexamples.map(({ measures }, i) => mark(x(measures[across]), y(measures[up]), i));
  const where = others.map(i => withUnit(`${data.measures[i].name} ${plain(held[i])}`, data.measures[i].unit)).join(", ");
  const words = `${label(up)} over ${label(across)}`;
  return el(
    "figure",
    null,
    svg(
      "svg",
      { viewBox: `0 0 ${width} ${height}`, role: "img", "aria-label": `${words}: runs, failures, boundary` },
      ...grid(us, vs, x, y),
      ...far,
      ...close,
      ...lines,
      ...marks,
      svg("text", { x: (left + width - right) / 2, y: height - 8, class: "title" }, label(across)),
      svg("text", { transform: `translate(13 ${(top + height - bottom) / 2}) rotate(-90)`, class: "title" }, label(up)),
    ),
    el("figcaption", { class: "muted" }, where ? `Boundary at ${where}` : "All measures are shown"),
  );
}

function grid(us, vs, x, y) {
  const { width, height, left, right, top, bottom } = SIZE;
  const down = ticks(us[0], us[1], 5).flatMap(u => [
    svg("line", { x1: x(u), x2: x(u), y1: top, y2: height - bottom, class: "grid" }),
    svg("text", { x: x(u), y: height - bottom + 15, class: "tick across" }, short(u)),
  ]);
  const along = ticks(vs[0], vs[1], 5).flatMap(v => [
    svg("line", { x1: left, x2: width - right, y1: y(v), y2: y(v), class: "grid" }),
    svg("text", { x: left - 5, y: y(v) + 4, class: "tick up" }, short(v)),
  ]);
  return [...down, ...along];
}

/** A counterexample: a star, or a diamond for the second. */
function mark(cx, cy, index) {
  const radii = index ? [8, 5.5] : [9, 4],
    corners = index ? 4 : 10;
  const points = Array.from({ length: corners }, (_, i) => {
    const angle = (2 * Math.PI * i) / corners - Math.PI / 2,
      radius = radii[i % 2];
    return `${(cx + radius * Math.cos(angle)).toFixed(1)},${(cy + radius * Math.sin(angle)).toFixed(1)}`;
  });
  return svg("polygon", { points: points.join(" "), class: `mark mark-${index}` });
}
