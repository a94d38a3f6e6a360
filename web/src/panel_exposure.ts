// Exposure of a view: changes of mode and metering apply at once, those of the other keys when a button is pressed. The daemon lists the keys that
// have an effect.

import type { MessageInitShape } from "@bufbuild/protobuf";

import type { ExposureSettings, ExposureSettingsSchema } from "../gen/steradian/v1/view_pb.ts";
import { field, make, numberInput, numberOf, select } from "./dom.ts";
import { FormState, type Model, type SceneChange } from "./model.ts";
import { notify } from "./notices.ts";
import type { Pictures } from "./pictures.ts";

type NumberKey = "limitingMagnitude" | "ev100" | "key" | "spotDeg" | "compensationEv" | "minEv100" | "maxEv100" | "adaptationS";

/** Keys with a number: name in masks, label, unit. */
const KEYS: readonly (readonly [key: NumberKey, path: string, label: string, unit: string])[] = [
  ["limitingMagnitude", "limiting_magnitude", "Limiting magnitude", "mag"],
  ["ev100", "ev100", "Exposure value", "EV100"],
  ["key", "key", "Key", "of display white"],
  ["spotDeg", "spot_deg", "Spot", "°"],
  ["compensationEv", "compensation_ev", "Compensation", "EV"],
  ["minEv100", "min_ev100", "Lowest", "EV100"],
  ["maxEv100", "max_ev100", "Highest", "EV100"],
  ["adaptationS", "adaptation_s", "Adaptation", "s"],
];

const MODES = [
  ["auto", "automatic"],
  ["manual", "manual"],
] as const;
const METERING = [
  ["limiting_magnitude", "limiting magnitude"],
  ["mean", "mean luminance"],
  ["spot", "spot in the middle"],
] as const;

export function exposurePanel(host: HTMLElement, model: Model, pictures: Pictures): void {
  const state = new FormState();
  const choice = make("select", { name: "exposure-view" });
  const form = make("form");
  host.append(field("View", choice), form);
  state.watch(form);

  const change = async (exposure: MessageInitShape<typeof ExposureSettingsSchema>, paths: string[]) => {
    const masked = paths.map((path) => (path ? `exposure.${path}` : "exposure"));
    const done = await model.changeView({ name: choice.value, exposure }, masked, state.revision);
    state.dirty = false;
    if (model.scene) state.revision = model.scene.revision;
    fill();
    if (done) notify(`Exposure of ${choice.value} is set.`);
  };

  const fill = () => {
    const view = model.views.find(({ name }) => name === choice.value);
    if (!view) return form.replaceChildren();
    const exposure: Partial<ExposureSettings> = view.exposure ?? {};
    const mode = select("mode", MODES, exposure.mode ?? "auto");
    mode.addEventListener("change", () => void change({ mode: mode.value }, ["mode"]));
    const rows = [field("Mode", mode)];
    if (exposure.metering !== undefined) {
      const metering = select("metering", METERING, exposure.metering);
      metering.addEventListener("change", () => void change({ metering: metering.value }, ["metering"]));
      rows.push(field("Metering", metering));
    }
    const inputs = new Map<NumberKey, HTMLInputElement>();
    for (const [key, path, label, unit] of KEYS) {
      if (exposure[key] === undefined) continue;
      const input = numberInput(path, exposure[key]);
      inputs.set(key, input);
      rows.push(field(label, input, unit));
    }
    const own = view.ownKeys.filter((key) => key.startsWith("exposure."));
    const inherits = own.length > 0 ? `Own keys: ${own.map((key) => key.slice(9)).join(", ")}.` : "All keys are inherited from the general settings.";
    const group = view.exposureGroup ? ` Shared by the group ${view.exposureGroup}.` : "";
    const inherit = make("button", {
      type: "button",
      text: "Use general settings",
      disabled: own.length === 0,
      onclick: () => void change({}, [""]),
    });
    form.replaceChildren(
      ...rows,
      make("p", { class: "hint", text: inherits + group }),
      make("div", { class: "buttons" }, make("button", { type: "submit", text: "Apply" }), inherit),
    );
    form.onsubmit = (event) => {
      event.preventDefault();
      try {
        const changed: MessageInitShape<typeof ExposureSettingsSchema> = {};
        const paths: string[] = [];
        for (const [key, path] of KEYS) {
          const input = inputs.get(key);
          // A key whose input was emptied is inherited again.
          const value = input && numberOf(input);
          if (!input || input.value === input.defaultValue || value === exposure[key]) continue;
          if (value !== undefined) changed[key] = value;
          paths.push(path);
        }
        if (paths.length === 0) return notify("No changes.");
        void change(changed, paths);
      } catch (error) {
        notify(String(error), "error");
      }
    };
  };

  const choose = () => {
    state.dirty = false;
    if (model.scene) state.revision = model.scene.revision;
    fill();
  };
  choice.addEventListener("change", choose);
  // Follow the displayed views, unless the user is editing another one.
  pictures.addEventListener("select", () => {
    const [first] = pictures.selected;
    if (first === undefined || state.dirty || pictures.selected.includes(choice.value)) return;
    choice.value = first;
    choose();
  });
  model.addEventListener("change", (event) => {
    if (!model.scene) return;
    // The exposure of the headset comes from the configuration and cannot be changed.
    const names = model.views.filter(({ type }) => type !== "headset").map(({ name }) => name);
    if (names.join() !== [...choice.options].map(({ value }) => value).join()) {
      const chosen = choice.value;
      choice.replaceChildren(...names.map((name) => make("option", { value: name, text: name, selected: name === chosen })));
    }
    if (state.follows(model.scene, (event as CustomEvent<SceneChange>).detail)) fill();
  });
}
