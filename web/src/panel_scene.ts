// Stars, time and grids of the scene; bodies have a separate panel.

import { timestampFromMs } from "@bufbuild/protobuf/wkt";

import { field, make, numberInput, numberOf, plain } from "./dom.ts";
import { FormState, type Model, type SceneChange } from "./model.ts";
import { notify } from "./notices.ts";

const GRIDS = [
  ["equatorial", "Equatorial"],
  ["galactic", "Galactic"],
  ["altitude", "Altitude and azimuth of the camera"],
] as const;

/** Interval at which a running time is displayed. */
const SHOW_INTERVAL_MS = 500;
/** If a time in the form differs by less than this from the scene's, it was not edited, ms. */
const ENTERED_MS = 2000;

/** Time steps, s. */
const STEPS = [
  [-86_400, "−1 day"],
  [-3600, "−1 h"],
  [3600, "+1 h"],
  [86_400, "+1 day"],
] as const;

/** Formats a time for a text input: ISO 8601, UTC, without zero fractions. */
const iso = (ms: number): string => new Date(ms).toISOString().replace(".000Z", "Z");

export function scenePanel(host: HTMLElement, model: Model): void {
  stars(host, model);
  time(host, model);
  grids(host, model);
  fields(host, model);
}

/** Calls the form's function when the form must be filled. */
function follow(model: Model, state: FormState, fill: () => void): void {
  model.addEventListener("change", (event) => {
    if (model.scene && state.follows(model.scene, (event as CustomEvent<SceneChange>).detail)) fill();
  });
}

/** Fills a choice with names, unless it has them. */
function offer(choice: HTMLSelectElement, names: readonly string[]): void {
  if (names.join() === [...choice.options].map(({ value }) => value).join()) return;
  choice.replaceChildren(...names.map((name) => make("option", { value: name, text: name.replaceAll("-", " ") })));
}

function stars(host: HTMLElement, model: Model): void {
  const state = new FormState();
  const method = make("select", { name: "method" });
  const limit = numberInput("magnitude_limit");
  const impostor = make("select", { name: "impostor" });
  const quality = numberInput("quality");
  const catalogues = make("p", { class: "hint" });
  const form = make(
    "form",
    {},
    make("h3", { text: "Stars" }),
    catalogues,
    field("Method", method),
    field("Magnitude limit", limit, "mag"),
    make("h3", { text: "Asteroids" }),
    field("Impostors", impostor),
    field("Level of detail", quality, "factor"),
    make("div", { class: "buttons" }, make("button", { type: "submit", text: "Apply" })),
  );
  host.append(form);
  state.watch(form);
  const fill = () => {
    const scene = model.scene;
    offer(method, model.info?.starMethods ?? []);
    offer(impostor, model.info?.impostorMethods ?? []);
    method.value = scene?.stars?.method ?? "";
    limit.value = plain(scene?.stars?.magnitudeLimit ?? 0);
    impostor.value = scene?.asteroids?.impostor ?? "";
    quality.value = plain(scene?.asteroids?.quality ?? 0);
    const sum = scene?.catalogues.map(({ name, stars: count }) => `${name}: ${count.toLocaleString("en")} stars`);
    catalogues.textContent = sum?.join("; ") || "No catalogue.";
  };
  follow(model, state, fill);
  form.addEventListener("submit", async (event) => {
    event.preventDefault();
    const scene = model.scene;
    if (!scene) return;
    try {
      const changed = {
        stars: { method: method.value, magnitudeLimit: numberOf(limit) ?? 0 },
        asteroids: { impostor: impostor.value, quality: numberOf(quality) ?? 0 },
      };
      const paths: string[] = [];
      if (changed.stars.method !== scene.stars?.method) paths.push("stars.method");
      if (changed.stars.magnitudeLimit !== scene.stars?.magnitudeLimit) paths.push("stars.magnitude_limit");
      if (changed.asteroids.impostor !== scene.asteroids?.impostor) paths.push("asteroids.impostor");
      if (changed.asteroids.quality !== scene.asteroids?.quality) paths.push("asteroids.quality");
      if (paths.length === 0) return notify("No changes.");
      if (!(await model.changeScene(changed, paths, state.revision))) return;
      state.dirty = false;
      if (model.scene) state.revision = model.scene.revision;
      fill();
      notify("Stars and asteroids are set.");
    } catch (error) {
      notify(String(error), "error");
    }
  });
}

function time(host: HTMLElement, model: Model): void {
  const state = new FormState();
  const input = make("input", { name: "time", type: "text", spellcheck: "false", required: true });
  const rate = numberInput("time_rate");
  const play = make("button", { type: "button", id: "play", text: "Play" });
  const observer = make("p", { id: "observer", class: "hint" });
  const form = make(
    "form",
    {},
    make("h3", { text: "Time" }),
    field("Time shown", input, "UTC, ISO 8601"),
    field("Time rate", rate, "scene seconds per second"),
    observer,
  );
  host.append(form);
  state.watch(form);
  // Rate that Play sets again after a pause.
  let lastRate = 1;
  const show = () => {
    const shown = model.timeMs();
    input.value = shown === undefined ? "" : iso(Math.floor(shown / 1000) * 1000);
  };
  const fill = () => {
    show();
    const now = model.scene?.timeRate ?? 0;
    if (now !== 0) lastRate = now;
    rate.value = plain(now);
    play.textContent = now === 0 ? "Play" : "Pause";
    const place = model.scene?.observer;
    const [latitude, longitude] = [place?.latitudeDeg ?? 0, place?.longitudeDeg ?? 0];
    observer.textContent = place
      ? `Seen from ${Math.abs(latitude).toFixed(4)}° ${latitude < 0 ? "S" : "N"}, ${Math.abs(longitude).toFixed(4)}° ${longitude < 0 ? "W" : "E"}, ${place.heightM.toFixed(0)} m`
      : "";
  };
  follow(model, state, fill);
  // While the time runs, the display follows it.
  setInterval(() => {
    if (!state.dirty && model.scene && model.scene.timeRate !== 0) show();
  }, SHOW_INTERVAL_MS);
  const change = async (values: Parameters<Model["changeScene"]>[0], paths: string[]) => {
    if (!(await model.changeScene(values, paths, state.revision))) return;
    state.dirty = false;
    if (model.scene) state.revision = model.scene.revision;
    fill();
  };
  const set = async (ms: number) => {
    if (!Number.isFinite(ms)) return notify(`time = ${input.value}: must be a time such as 2026-01-01T00:00:00Z`, "error");
    await change({ time: timestampFromMs(ms) }, ["time"]);
  };
  const step = (seconds: number) => set((model.timeMs() ?? Date.now()) + 1000 * seconds);
  play.addEventListener("click", () => void change({ timeRate: model.scene?.timeRate ? 0 : lastRate }, ["time_rate"]));
  form.append(
    make(
      "div",
      { class: "buttons" },
      make("button", { type: "submit", text: "Apply" }),
      play,
      make("button", { type: "button", text: "Now", onclick: () => void set(Math.floor(Date.now() / 1000) * 1000) }),
      ...STEPS.map(([seconds, text]) => make("button", { type: "button", text, onclick: () => void step(seconds) })),
    ),
  );
  form.addEventListener("submit", (event) => {
    event.preventDefault();
    try {
      const timeRate = numberOf(rate) ?? 0;
      const shown = input.value.trim();
      // A text without a zone would be interpreted in the browser's time zone.
      const ms = Date.parse(/(Z|[+-]\d\d:?\d\d)$/i.test(shown) ? shown : `${shown}Z`);
      if (timeRate === model.scene?.timeRate) return void set(ms);
      // A displayed time that merely follows the scene was not edited.
      const entered = Math.abs(ms - (model.timeMs() ?? Number.NaN)) > ENTERED_MS;
      if (!entered) return void change({ timeRate }, ["time_rate"]);
      if (!Number.isFinite(ms)) return void set(ms);
      void change({ time: timestampFromMs(ms), timeRate }, ["time", "time_rate"]);
    } catch (error) {
      notify(String(error), "error");
    }
  });
}

function grids(host: HTMLElement, model: Model): void {
  const set = make("fieldset", {}, make("legend", { text: "Grids over the pictures" }));
  host.append(set);
  const boxes = GRIDS.map(([kind, label]) => {
    const box = make("input", { type: "checkbox", name: `grid-${kind}`, id: `grid-${kind}` });
    box.addEventListener("change", async () => {
      const scene = model.scene;
      if (!scene) return;
      const others = scene.overlay?.grids.filter((grid) => grid.kind !== kind) ?? [];
      const wanted = box.checked ? [...others, { kind }] : others;
      await model.changeScene({ overlay: { grids: wanted } }, ["overlay.grids"], scene.revision);
      fill();
    });
    set.append(make("div", { class: "check" }, box, make("label", { for: box.id, text: label })));
    return [kind, box] as const;
  });
  const fill = () => {
    for (const [kind, box] of boxes) box.checked = model.scene?.overlay?.grids.some((grid) => grid.kind === kind) ?? false;
  };
  model.addEventListener("change", fill);
}

function fields(host: HTMLElement, model: Model): void {
  const list = make("ul", { class: "plain" });
  const section = make("section", {}, make("h3", { text: "Asteroid fields" }), list);
  host.append(section);
  model.addEventListener("change", () => {
    const all = model.scene?.asteroidFields ?? [];
    const revision = model.scene?.revision ?? 0n;
    list.replaceChildren(
      ...all.map(({ name, instances }) => {
        const remove = make("button", {
          type: "button",
          text: "Remove",
          "aria-label": `Remove the field ${name}`,
          onclick: () => void model.changeScene({}, [`asteroid_fields.${name}`], revision),
        });
        return make("li", {}, make("span", { text: `${name}: ${instances.toLocaleString("en")}` }), remove);
      }),
    );
    if (all.length === 0) list.append(make("li", { class: "hint", text: "None." }));
  });
}
