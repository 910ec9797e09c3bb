// The panel beside the player, saving, and the first run.

const names = data.systems.map(name => [name, name]);
const systemA = choice("System under test", names, data.system, chooseSystems),
  systemB = choice("Compare with", [["", "nothing"], ...names], "", chooseSystems);

function chooseSystems() {
  chosenSystems = [systemA.value, systemB.value].filter(Boolean);
  renew();
}

const saveName = el("input", {
  type: "text",
  id: "save-name",
  value: `${data.name}_explored`,
  "aria-label": "Name of the file",
});
const saveTold = el("p", { class: "muted saved", role: "status" });

async function save(kind) {
  const varied = map.cells.length ? { [map.axes[0]]: map.x, [map.axes[1]]: map.y } : {};
  try {
    const { files } = await (await ask("save", { parameters: point, name: saveName.value.trim(), kind, varied })).json();
    saveTold.textContent = `written: ${files.join(", ")}`;
  } catch (error) {
    saveTold.textContent = error.message;
  }
}

const explored = el(
  "div",
  { class: "explored", keydown: event => event.stopPropagation() }, // the player's keys are for its own parts
  el(
    "section",
    { class: "panel", "aria-label": "Parameters" },
    data.folder ? el("p", null, el("a", { href: "." }, "← All runs")) : null,
    el("h2", null, "Parameters"),
    el("p", { class: "muted" }, data.description),
    status,
    fault,
    el(
      "div",
      { class: "pick", style: "margin-top:8px" },
      el("span", null, "System"),
      systemA,
      el("span", null, "Compare"),
      systemB,
    ),
    ...knobs.map(each => each.node),
    data.parameters.length ? null : el("p", { class: "muted" }, "This scenario declares no parameters."),
    el(
      "p",
      { style: "margin-top:6px" },
      button("Back to the values at the beginning", () => setPoint(asDeclared), null, "Reset"),
    ),
  ),
  mapPanel,
  section(
    "Save",
    data.saves
      ? el(
          "div",
          { class: "pick" },
          el("label", { for: "save-name" }, "Name"),
          saveName,
          button("Save the point as a scenario", () => save("scenario"), null, "Scenario"),
          button("Save the map as a variation", () => save("variation"), null, "Variation of the map"),
        )
      : el("p", { class: "muted" }, "Start the command with --out DIR to save scenarios and variations."),
    saveTold,
  ),
);
pair.replaceWith(el("h1", null, data.name));
desk.prepend(explored);
desk.append(headlines); // below the film: sentences change as sliders move, and the film stays where it is
playPoint();
