// What became of the failures of an earlier loop, of another version of the system under test.

const FATES = {
  fixed: ["passed", "fixed"],
  "still-there": ["failed", "still there"],
  unknown: ["error", "unknown"],
  new: ["failed", "new"],
  "missed-before": ["plain", "missed before"],
  unlike: ["plain", "unlike"],
};
const NEITHER_FAILS = "Neither of the two fails in it.",
  NOTHING_KNOWN = "No failure is known of it.";
const counted = counts =>
  Object.entries(FATES)
    .filter(([fate]) => ["fixed", "still-there", "new"].includes(fate) || counts[fate])
    .flatMap(([fate, [kind, text]]) => [badge(counts[fate] ? kind : "plain", `${counts[fate]} ${text}`), " "]);

function against() {
  const found = data.against;
  if (!found) return null;
  const blind = found.compared.filter(each => each.blind).length;
  return el(
    "section",
    { class: "panel" },
    el("h2", null, `Against ${found.sut} (${found.folder})`),
    el(
      "p",
      null,
      ...counted(found.counts),
      blind ? badge("error", `nothing known of ${many(blind, "search", "searches")}`) : null,
    ),
    el(
      "p",
      { class: "muted" },
      "Failures among the edge cases of that loop are replayed on this system. One is fixed where it is survived and no edge " +
        "case found now is a failure like it. Failures unlike all of before are played with the former system: new where it " +
        "survives, missed before where it fails too, unlike where it cannot be played any more.",
    ),
    ...found.compared.map(each => compared(each)),
  );
}

function compared(each) {
  const { unknown } = each.counts;
  const now = new Map(cases.map(found => [found.files.scenario, found]));
  const rows = [
    ...each.before.map(({ values, fate }) => failure(fate, "–", values)),
    ...Object.entries(each.others).map(([file, fate]) =>
      failure(fate, play(now.get(file).play, now.get(file).name), now.get(file).theta),
    ),
    ...each.new.map(file => failure("new", play(now.get(file).play, now.get(file).name), now.get(file).theta)),
  ];
  const columns = [
    ["failure", null],
    ["replay", null],
    ["parameters", null],
  ];
  return el(
    "details",
    { class: "group" },
    el(
      "summary",
      null,
      el("h3", null, each.title),
      " ",
      ...(each.blind ? [badge("error", unknown ? `${unknown} unknown` : "not known"), " "] : counted(each.counts)),
      el("span", { class: "muted" }, each.reason),
    ),
    rows.length ? table(each.title, columns, rows) : el("p", { class: "muted" }, each.reason ? NOTHING_KNOWN : NEITHER_FAILS),
  );
}

function failure(fate, replay, values) {
  const listed = Object.entries(values).map(([name, value]) => `${name} ${isNaN(value) ? value : short(Number(value))}`);
  return el(
    "tr",
    null,
    el("td", null, badge(...FATES[fate])),
    el("td", null, replay),
    el("td", { class: "theta muted" }, listed.join(", ")),
  );
}
