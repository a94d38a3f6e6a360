// Bodies of the scene: a list, and a form for one of them. The mask of a change names only this body, so that changes to other bodies are kept.

import { clone, create } from "@bufbuild/protobuf";

import { type Body, BodySchema, EmissionSchema, RgbSchema, SpinSchema } from "../gen/steradian/v1/scene_pb.ts";
import { Vector3Schema } from "../gen/steradian/v1/camera_pb.ts";
import { field, make, numberInput, numberOf, select } from "./dom.ts";
import { FormState, type Model, type SceneChange } from "./model.ts";
import { notify } from "./notices.ts";

const LAWS = [
  ["lommel_seeliger", "Lommel-Seeliger"],
  ["lambert", "Lambert"],
] as const;

/** Three inputs in a row. */
class Triple {
  readonly element: HTMLElement;
  #inputs: HTMLInputElement[];

  constructor(
    private readonly name: string,
    label: string,
    unit: string,
    parts: readonly [string, string, string],
    values: readonly number[] = [],
    private readonly required = false,
  ) {
    this.#inputs = parts.map((part, index) => {
      const input = numberInput(`${name}.${part}`, values[index]);
      input.setAttribute("aria-label", `${label}, ${part}${unit && `, ${unit}`}`);
      input.placeholder = part;
      return input;
    });
    const legend = make("legend", { text: `${label} ` }, make("span", { class: "unit", text: unit }));
    this.element = make("fieldset", { class: "triple" }, legend, ...this.#inputs);
  }

  /** Returns the numbers; undefined if all three are empty, which is an error if they are required. */
  read(): [number, number, number] | undefined {
    const numbers = this.#inputs.map(numberOf);
    const [a, b, c] = numbers;
    if (a !== undefined && b !== undefined && c !== undefined) return [a, b, c];
    if (this.required || numbers.some((number) => number !== undefined)) throw new Error(`${this.name}: three numbers are needed`);
    return undefined;
  }
}

const XYZ = ["x", "y", "z"] as const;
const RGB = ["red", "green", "blue"] as const;

export function bodiesPanel(host: HTMLElement, model: Model): void {
  const state = new FormState();
  const list = make("ul", { class: "plain", id: "bodies" });
  const editor = make("form", { id: "body-form", hidden: true });
  const addButton = make("button", { type: "button", text: "Add a body", onclick: () => edit(undefined) });
  host.append(list, make("div", { class: "buttons" }, addButton), editor);
  state.watch(editor);
  /** Name of the body in the form; empty: a new one. */
  let edited: string | undefined;

  const close = () => {
    edited = undefined;
    state.dirty = false;
    editor.hidden = true;
    editor.replaceChildren();
  };

  const change = async (bodies: Body[], name: string, message: string) => {
    const done = await model.changeScene({ bodies }, [`bodies.${name}`], state.revision);
    if (!done) return;
    close();
    notify(message);
    addButton.focus();
  };

  const edit = (body: Body | undefined) => {
    edited = body?.name ?? "";
    state.dirty = false;
    state.revision = model.scene?.revision ?? 0n;
    const name = make("input", { name: "name", type: "text", required: true, pattern: "[A-Za-z0-9_\\-]{1,64}", title: "Letters, digits, _ and -", readonly: body !== undefined });
    name.value = edited;
    const vector = (v?: { x: number; y: number; z: number }) => (v ? [v.x, v.y, v.z] : []);
    const colour = (c?: { red: number; green: number; blue: number }) => (c ? [c.red, c.green, c.blue] : []);
    const position = new Triple("position_m", "Position", "m, ICRS", XYZ, vector(body?.positionM), true);
    const radii = new Triple("radii_m", "Semi-axes", "m", XYZ, vector(body?.radiiM), true);
    const albedo = new Triple("geometric_albedo", "Geometric albedo", "0 to 2", RGB, colour(body?.geometricAlbedo));
    const emission = new Triple("luminance_cd_m2", "Luminance of a sun", "cd/m²", RGB, colour(body?.emission?.luminanceCdM2));
    const law = select("law", LAWS, body?.law || "lommel_seeliger");
    const texture = make("input", { name: "texture_of", type: "text", spellcheck: "false" });
    texture.value = body?.textureOf ?? "";
    const period = numberInput("period_s", body?.spin?.periodS);
    const phase = numberInput("phase_rad", body?.spin?.phaseRad);
    const darkening = numberInput("limb_darkening", body?.emission?.limbDarkening);
    editor.replaceChildren(
      make("h3", { text: body ? `Body ${body.name}` : "New body" }),
      field("Name", name),
      position.element,
      radii.element,
      albedo.element,
      field("Reflection law", law),
      field("Texture of", texture, "body of the configuration"),
      field("Rotation period", period, "s, empty: none"),
      field("Rotation angle at J2000", phase, "rad"),
      emission.element,
      field("Limb darkening", darkening, "0 to 1"),
      make(
        "div",
        { class: "buttons" },
        make("button", { type: "submit", text: body ? "Save" : "Add" }),
        make("button", { type: "button", text: "Cancel", onclick: close }),
      ),
    );
    editor.hidden = false;
    editor.onsubmit = (event) => {
      event.preventDefault();
      try {
        // Keep the orientation, which the form does not show.
        const made = body ? clone(BodySchema, body) : create(BodySchema);
        made.name = name.value;
        const vector3 = ([x, y, z]: readonly [number, number, number]) => create(Vector3Schema, { x, y, z });
        const rgb = ([red, green, blue]: readonly [number, number, number]) => create(RgbSchema, { red, green, blue });
        const [placed, axes, reflected, light] = [position.read(), radii.read(), albedo.read(), emission.read()];
        if (placed) made.positionM = vector3(placed);
        if (axes) made.radiiM = vector3(axes);
        if (reflected) made.geometricAlbedo = rgb(reflected);
        else delete made.geometricAlbedo;
        made.law = law.value;
        made.textureOf = texture.value.trim();
        const [turn, angle] = [numberOf(period), numberOf(phase)];
        if (turn !== undefined || angle !== undefined) {
          made.spin = create(SpinSchema, { ...(turn === undefined ? {} : { periodS: turn }), phaseRad: angle ?? 0 });
        } else delete made.spin;
        if (light) {
          made.emission = create(EmissionSchema, { luminanceCdM2: rgb(light), limbDarkening: numberOf(darkening) ?? 0 });
        } else delete made.emission;
        const taken = !body && model.scene?.bodies.some((other) => other.name === made.name);
        if (taken) throw new Error(`name: there is a body ${made.name} already`);
        void change([made], made.name, `Body ${made.name} is ${body ? "saved" : "added"}.`);
      } catch (error) {
        notify(error instanceof Error ? error.message : String(error), "error");
      }
    };
    (body ? editor.querySelector<HTMLInputElement>("fieldset input") : name)?.focus();
  };

  model.addEventListener("change", (event) => {
    const scene = model.scene;
    if (!scene) return;
    list.replaceChildren(
      ...scene.bodies.map((body) => {
        const about = body.emission ? "sun" : `${(Math.max(body.radiiM?.x ?? 0, body.radiiM?.y ?? 0, body.radiiM?.z ?? 0) / 1000).toPrecision(4)} km`;
        return make(
          "li",
          {},
          make("span", {}, make("strong", { text: body.name }), ` ${about}`),
          make("button", { type: "button", text: "Edit", "aria-label": `Edit ${body.name}`, onclick: () => edit(body) }),
          make("button", {
            type: "button",
            text: "Remove",
            "aria-label": `Remove ${body.name}`,
            onclick: () => {
              state.revision = scene.revision;
              void change([], body.name, `Body ${body.name} is removed.`);
            },
          }),
        );
      }),
    );
    if (scene.bodies.length === 0) list.append(make("li", { class: "hint", text: "The scene has no bodies." }));
    const filled = state.follows(scene, (event as CustomEvent<SceneChange>).detail);
    if (!filled || edited === undefined) return;
    // Fill the form with the current values of the body.
    const body = scene.bodies.find(({ name }) => name === edited);
    if (edited !== "" && !body) {
      notify(`Body ${edited} is gone.`, "warning");
      close();
    } else if (edited !== "") edit(body);
  });
}
