// The observer's place on the Earth. Only the configuration can add an observer; the form moves it.

import { field, make, numberInput, numberOf, plain } from "./dom.ts";
import { FormState, type Model, type SceneChange } from "./model.ts";
import { notify } from "./notices.ts";

export function placePanel(host: HTMLElement, model: Model): void {
  const state = new FormState();
  const latitude = numberInput("latitude_deg");
  const longitude = numberInput("longitude_deg");
  const height = numberInput("height_m");
  const apply = make("button", { type: "submit", text: "Apply" });
  const none = make("p", { class: "hint", text: "The configuration has no observer: the scene is seen from the camera's position." });
  const keys = make(
    "div",
    {},
    field("Latitude", latitude, "°, north positive"),
    field("Longitude", longitude, "°, east positive"),
    field("Height", height, "m"),
    make("div", { class: "buttons" }, apply),
  );
  const form = make("form", { id: "place-form" }, make("h3", { text: "Place" }), none, keys);
  host.append(form);
  state.watch(form);
  const fill = () => {
    const place = model.scene?.observer;
    none.hidden = place !== undefined;
    keys.hidden = place === undefined;
    apply.disabled = model.info?.role === "view";
    latitude.value = plain(place?.latitudeDeg ?? 0);
    longitude.value = plain(place?.longitudeDeg ?? 0);
    height.value = plain(place?.heightM ?? 0);
  };
  model.addEventListener("change", (event) => {
    if (model.scene && state.follows(model.scene, (event as CustomEvent<SceneChange>).detail)) fill();
  });
  form.addEventListener("submit", async (event) => {
    event.preventDefault();
    const place = model.scene?.observer;
    if (!place) return;
    try {
      const wanted = { latitudeDeg: numberOf(latitude) ?? 0, longitudeDeg: numberOf(longitude) ?? 0, heightM: numberOf(height) ?? 0 };
      const paths: string[] = [];
      // The form displays fewer digits. A value that equals the current one in these digits was not edited.
      if (plain(wanted.latitudeDeg) !== plain(place.latitudeDeg)) paths.push("observer.latitude_deg");
      if (plain(wanted.longitudeDeg) !== plain(place.longitudeDeg)) paths.push("observer.longitude_deg");
      if (plain(wanted.heightM) !== plain(place.heightM)) paths.push("observer.height_m");
      if (paths.length === 0) return notify("No changes.");
      if (!(await model.changeScene({ observer: wanted }, paths, state.revision))) return;
      state.dirty = false;
      if (model.scene) state.revision = model.scene.revision;
      fill();
      notify("The place is set.");
    } catch (error) {
      notify(String(error), "error");
    }
  });
}
