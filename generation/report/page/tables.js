// How often it fails, counterexamples, drivers by case, another version of the system, how all of it was found.

const cell = (text, kind = "number") => el("td", { class: kind }, text);
const spanned = ([best, low, high], scale = 1) => {
  const [at, from, to] = [best, low, high].map(each => even(each * scale));
  return best > 0 ? `${at} [${from}, ${to}]` : `at most ${to}`;
};

function often() {
  const found = data.estimate;
  if (!found) return null;
  const rated = found.events.some(each => each.rates.length);
  const columns = [
    ["event", null],
    ["P(event | manoeuvre), % [95 %]", "number"],
    ...(rated
      ? [
          ["per hour of driving", "number"],
          ["per 1,000 km", "number"],
        ]
      : []),
    ["effective failures", "number"],
  ];
  const rows = found.events.map(each =>
    el(
      "tr",
      null,
      el("th", { scope: "row" }, each.name),
      cell(spanned(each.chance, 100)),
      ...each.rates.map(rate => cell(spanned(rate))),
      cell(each.stable || !each.chance[0] ? String(each.effective) : `${each.effective}: unstable`),
    ),
  );
  const where = found.known
    ? `around ${many(found.known, "known failure")}`
    : "drawn from the density, as too few failures are known";
  return panel(
    "How often",
    table("How often", columns, rows),
    note(
      `${many(found.runs, "run")} ${where}` + (found.failed ? `; ${found.failed} more failed, and count for nothing` : "") + ". ",
      rated ? `Rates are of ${found.driving}, and hold for such traffic.` : `No rates: ${found.driving}.`,
    ),
  );
}

function regions() {
  if (!data.regions.length) return null;
  const units = Object.keys(data.regions[0].rates);
  const columns = [
    ["region", null],
    ["rule", null],
    ["precision [95 %]", "number"],
    ["recall [95 %]", "number"],
    ["failures", "number"],
    ["probability, % [95 %]", "number"],
    ...units.map(each => [each, "number"]),
    ["mean impact (m/s)", "number"],
    ["edge cases", "number"],
    ["survived by", null],
    ["typical member", null],
    ["likeliest member", null],
  ];
  const member = (each, name) =>
    el(
      "td",
      null,
      play(each.files[name].play, `${each.name}, ${name} member`),
      " ",
      Object.entries(each[name])
        .map(([measure, value]) => `${measure} ${figure(value, 3)}`)
        .join(", "),
      each.files[name].reproduced ? null : " (not reproduced by its file)",
    );
  const rows = data.regions.map(each =>
    el(
      "tr",
      null,
      el("th", { scope: "row" }, each.name),
      cell(each.rule, null),
      cell(each.precision_draws ? spanned([each.precision, ...each.precision_interval]) : "no draws"),
      cell(each.recall_draws ? spanned([each.recall, ...each.recall_interval]) : "no draws"),
      cell(String(each.failures)),
      cell(each.draws ? spanned([each.probability, ...each.interval], 100) : "no draws"),
      ...units.map(unit => cell(spanned(each.rates[unit]))),
      cell(figure(each.severity, 3)),
      cell(String(each.edge_cases)),
      cell(
        Object.entries(each.survived)
          .filter(([, number]) => number)
          .map(([name, number]) => `${name} ${number}`)
          .join(", "),
        null,
      ),
      member(each, "typical"),
      member(each, "likeliest"),
    ),
  );
  // Regions are parts of all failures: their probabilities add up to that of all.
  const sum = (name, part) =>
    el(
      "tr",
      { class: "totals" },
      el("th", { scope: "row" }, name),
      ...columns.slice(1, 5).map(() => cell("")),
      cell(part.draws ? spanned([part.probability, ...part.interval], 100) : "no draws"),
      ...columns.slice(6).map(() => cell("")),
    );
  const { others, all, weighted } = data.parts;
  rows.push(sum("other failures", others), sum("all failures", all));
  return panel(
    "Regions of failure",
    table("Regions of failure", columns, rows),
    note(
      "The most important first: regions with edge cases, then by probability times impact. " +
        "Failures of a region are linked by steps of 15 % of the ranges. " +
        "Precision is the share of unguided draws within a rule that fail, " +
          "recall the share of failing ones of the region within it, [95 %]: " +
        "as in traffic. Each failing draw belongs to the region of the known failure nearest to it, " +
        "so that probabilities add up; they are of " +
        (weighted ? `the estimate's ${many(all.draws, "draw")}.` : `${many(all.draws, "unguided draw")}.`),
    ),
  );
}

function counterexample(each, index) {
  const outcome = each.collision && !each.side
    ? "fails without a contact"
    : each.collision
    ? `${each.striking ? "hits the other one with" : "is hit at"} its ${each.side || "side"}, at ${figure(each.impact, 3)} m/s`
    : "no collision";
  const kinds = [
    badge(each.foreseeable ? "failed" : "plain", each.foreseeable ? "foreseeable" : "not foreseeable"),
    badge(each.preventable ? "failed" : "plain", each.preventable ? "preventable" : "not prevented"),
    badge(each.reproduced ? "passed" : "error", each.reproduced ? "reproduced by its file" : "not reproduced by its file"),
  ];
  const unit = each.recorded;
  const columns = [
    ["parameter", null],
    ["value", "number"],
    ...(unit ? [["nearest recorded unit", "number"]] : []),
  ];
  const rows = each.values.map(({ name, unit: of, value, recorded }) =>
    el(
      "tr",
      null,
      el("th", { scope: "row" }, name),
      cell(withUnit(figure(value, 4), of)),
      ...(unit ? [cell(recorded === null ? "" : withUnit(figure(recorded, 4), of))] : []),
    ),
  );
  const title = each.names.map(name => WHICH[name]).join(" and ");
  return el(
    "article",
    null,
    el("h3", null, el("i", { class: `mark mark-${index}` }), title[0].toUpperCase() + title.slice(1)),
    el("p", null, `The ego ${outcome}. `, ...kinds.flatMap(kind => [kind, " "])),
    el("p", { class: "actions" }, play(each.play, title), " ", el("a", { href: link(each.file) }, each.file)),
    table(title, columns, rows),
    unit ? note(`Recorded in ${unit.recording}, ${figure(100 * unit.distance)} % of the ranges away.`) : null,
  );
}

function examples() {
  const found = data.counterexamples;
  if (!found.length) return null;
  return panel("Counterexamples", el("div", { class: "examples" }, ...found.map(counterexample)));
}

function drivers() {
  const { cases } = data;
  if (!cases.length) return panel("Edge cases", el("p", null, "No failure is foreseeable and prevented by a careful driver."));
  const repeated = cases.some(each => each.repeated);
  const columns = [
    ["case", "number"],
    ["fails again", null],
    ...(repeated ? [["P(fail | values), % [95 %]", "number"]] : []),
    ["impact (m/s)", "number"],
    ...data.measures.map((_, i) => [label(i), "number"]),
    ["log-likelihood", "number"],
    ["risk", "number"],
    ...data.drivers.map(name => [name, "driver"]),
  ];
  const quoted = name => (/^[\w.\/][\w.\/-]*$/.test(name) ? name : `'${name.replaceAll("'", "''")}'`);
  const survived = data.drivers.map((_, i) => cases.filter(each => each.drivers[i] === "survives").length);
  const totals = el(
    "tr",
    { class: "totals" },
    el("th", { scope: "row", colspan: columns.length - data.drivers.length }, `survived, of ${cases.length}`),
    ...survived.map(count => cell(String(count), "driver")),
  );
  const row = each =>
    el(
      "tr",
      null,
      el("th", { scope: "row", class: "number" }, String(each.number), ...(each.fate ? [" ", badge(...FATES[each.fate])] : [])),
      cell(each.again === null ? "" : each.again ? "yes" : "no", null),
      ...(repeated ? [cell(each.repeated ? spanned(each.repeated, 100) : "")] : []),
      cell(each.collision ? figure(each.impact, 3) : "none"),
      ...each.measures.map(value => cell(plain(value))),
      cell(figure(each.likelihood, 3)),
      cell(figure(each.risk)),
      ...each.drivers.map(end => el("td", { class: `driver ${end}` }, { survives: "✓", collides: "✕", unknown: "?" }[end])),
    );
  const rows = cases.map(row),
    kinds = new Map([
      ...["case", "impact_speed", "log_likelihood", "risk"].map(name => [name, "number"]),
      ...data.measures.map(each => [each.name, "number"]),
      ["collision", "truth"],
      ["side", "text"],
      ...data.drivers.map(name => [name.replaceAll(/\W/g, "_"), "text"]),
    ]);
  const valueOf = (each, name) => {
    const own = { case: each.number, impact_speed: each.collision ? each.impact : null, log_likelihood: each.likelihood };
    if (name in own) return own[name];
    if (["risk", "collision", "side"].includes(name)) return each[name];
    const measure = data.measures.findIndex(one => one.name === name);
    if (measure >= 0) return each.measures[measure];
    return each.drivers[data.drivers.findIndex(one => one.replaceAll(/\W/g, "_") === name)];
  };
  const told = el("p", { class: "muted", role: "status" });
  const show = meets => {
    const met = cases.map(each => !meets || meets(each));
    rows.forEach((node, i) => (node.hidden = !met[i]));
    told.textContent = meets ? `${met.filter(Boolean).length} of ${cases.length} cases` : "";
  };
  return panel(
    "Reference drivers by case",
    el("div", { class: "choices" }, ...questionBox(kinds, valueOf, "impact_speed > 5 and r157_cc = 'survives'", show), told),
    note(
      `✓ survives, ✕ collides, ? not known. A case is preventable where ${data.judges.join(" or ")} survives; ` +
        "full braking from the instant on at which anyone changes speed or lane is the bound of what braking can do; it is not " +
        "known where nobody does before the contact, as with a target that stands. ",
      data.agreed ? `The others are played in arrays, which give all ${data.agreed} verdicts of the judges as runs do. ` : "",
      "Fails again: with the same seed; the probability is of other seeds. ",
      "Numbers are those of the sets in ",
      el("a", { href: link(data.file) }, data.file),
      `; xosc-run ${quoted(data.file)} --only NUMBER plays one.`,
    ),
    table("Reference drivers by case", columns, [totals, ...rows]),
  );
}

function against() {
  const found = data.against;
  if (!found) return null;
  const counts = Object.entries(FATES)
    .filter(([fate]) => ["fixed", "still-there", "new"].includes(fate) || found.counts[fate])
    .flatMap(([fate, [kind, text]]) => [badge(found.counts[fate] ? kind : "plain", `${found.counts[fate]} ${text}`), " "]);
  const regions = Object.entries(found.regions)
    .map(([shift, number]) => `${number} ${shift}`)
    .join(", ");
  const columns = [
    ["failure of before", "number"],
    ["now", null],
    ["impact (m/s)", "number"],
    ...found.names.map(name => [name, "number"]),
  ];
  const rows = found.failures.map(each =>
    el(
      "tr",
      null,
      el("th", { scope: "row", class: "number" }, String(each.number)),
      el("td", null, badge(...FATES[each.fate])),
      cell(each.impact ? figure(each.impact, 3) : "none"),
      ...found.names.map(name => cell(figure(isNaN(each.values[name]) ? each.values[name] : Number(each.values[name]), 4))),
    ),
  );
  const now = data.estimate?.events[0].chance;
  const change =
    found.chance && now
      ? note(`Collisions before: ${spanned(found.chance, 100)} % of manoeuvres, now: ${spanned(now, 100)} %.`)
      : null;
  return panel(
    `Against ${found.sut || "another version"} (${found.folder})`,
    el("p", null, ...counts),
    note(`Regions of failures: ${regions}.`),
    change,
    note(
      "Failures of before are replayed on this version. One is fixed where it is survived and nothing found now is like it; " +
        "failures unlike all of before are played with the former version: new where it survives, missed before where it fails " +
        "too, unlike where it cannot be played any more.",
    ),
    rows.length ? table("Failures of before", columns, rows) : el("p", null, "The search before had no failures."),
  );
}

function assurance() {
  const { can, cannot, coverage, sensitivity, exposure, versions, digests } = data.assured;
  const list = (title, sentences) => [
    el("h3", null, title),
    el("ul", null, ...sentences.map(text => el("li", null, `${text[0].toUpperCase()}${text.slice(1)}.`))),
  ];
  const rows = typeof sensitivity === "string" ? [] : Object.entries(sensitivity.total);
  const indices = table(
    "Sobol indices of failure",
    [
      ["parameter", null],
      ["alone [95 %]", "number"],
      ["with all others [95 %]", "number"],
    ],
    rows.map(([name, total]) =>
      el(
        "tr",
        null,
        el("th", { scope: "row" }, name),
        ...[sensitivity.first[name], total].map(found => {
          const [at, low, high] = found.map(each => each.toFixed(2));
          return cell(`${at} [${low}, ${high}]`);
        }),
      ),
    ),
  );
  const pairs = each => Object.entries(each).flatMap(([name, text]) => [el("dt", null, name), el("dd", null, text)]);
  return panel(
    "What this search can and cannot say",
    ...list("It says", can),
    ...list("It does not say", cannot),
    el("h3", null, "Tested cells"),
    note(
      `The range of each parameter that holds 99 % of the density has ${coverage.parts} equal parts, or the values of a set; ` +
        `cells of each two parameters (${many(coverage.pairs, "pair")}) without a foreseeable draw of the density are left out. `,
      coverage.untested.length ? `Likeliest without a run: ${coverage.untested.join("; ")}.` : "Each has a run.",
    ),
    el("h3", null, "What failures depend on"),
    ...(rows.length
      ? [
          indices,
          note(
            "Sobol indices: shares of the variance of failure, where parameters vary evenly and independently in that range, " +
              "by models of the runs; intervals are those of models of runs drawn anew.",
          ),
        ]
      : [note(sensitivity)]),
    el("h3", null, "Exposure"),
    typeof exposure === "string"
      ? note(exposure)
      : note(
          `${exposure.kind}: ${many(exposure.manoeuvres, "manoeuvre")} in ${figure(exposure.hours, 4)} h and ` +
            `${figure(exposure.kilometres, 4)} km of ${exposure.simulated ? "simulated " : ""}driving; ` +
            Object.entries(exposure.met)
              .map(([name, rate]) => `${spanned(rate)} ${name}`)
              .join(", "),
        ),
    el("h3", null, "Versions and digests"),
    el("dl", null, ...pairs(versions), ...pairs(digests)),
  );
}

function method() {
  const told = Object.entries(data.settings).flatMap(([name, value]) => [el("dt", null, name), el("dd", null, value)]);
  const [measured, recorded, refusal] = data.gate;
  return panel(
    "How it was found",
    el(
      "p",
      null,
      `Gate of the density: ${measured}. `,
      recorded ? badge(...(refusal ? ["failed", "refused"] : ["passed", "passes"])) : null,
    ),
    refusal ? el("p", null, `So it is no judge of what is foreseeable: ${refusal}.`) : null,
    el("dl", null, ...told),
  );
}
